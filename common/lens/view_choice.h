// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/lens/board_view.h"

namespace rigcal {

struct ViewChoiceLimits {
  // A view whose blur is this or less is sharp, whatever the others are.
  double sharp = 0;
  // Where more views differ, they must differ by more; 0: any number.
  size_t most = 0;
};

// Of the views of a camera or video that shows the same for long, those that make a lens: a corner
// has moved by 4 % of the image's diagonal since every other view, and the view is about as sharp
// as the sharpest one. What is chosen depends on the order.
class ViewChoice {
 public:
  enum class Verdict : uint8_t { kTaken = 1, kAlike, kBlurred };

  ViewChoice(const ImageSize& image_size_px, const ViewChoiceLimits& limits);

  // `blur` grows with the width of the edges, in any unit; 0: not known.
  Verdict Offer(const BoardView& view, double blur);

  const std::vector<BoardView>& views() const { return views_; }
  int alike() const { return alike_; }
  int blurred() const { return blurred_; }

 private:
  bool IsAlike(const BoardView& view, size_t others) const;
  void Thin();

  ViewChoiceLimits limits_;
  double moved_px_;
  double sharpest_ = 0;
  std::vector<BoardView> views_;
  int alike_ = 0;
  int blurred_ = 0;
};

}  // namespace rigcal
