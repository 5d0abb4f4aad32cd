// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/lens/board_view.h"
#include "common/lens/lens_adjustment.h"

namespace rigcal {

inline constexpr size_t kLeastCornersOfView = 6;

// Which corners and views of a lens are used.
struct UsedCorners {
  std::vector<std::vector<bool>> corners;  // view by view
  std::vector<std::string> left_out;       // why a view is not used; empty: it is

  // The views that are used, each with its corners that are used.
  std::vector<BoardView> Of(const std::vector<BoardView>& views) const;
  // Of an estimate with the poses of all views, that of the views that are used.
  LensEstimate Of(const LensEstimate& all) const;
  // The lens and the poses of the views that are used, into those of all.
  void Into(const LensEstimate& fitted, LensEstimate* all) const;
};

// Leaves out each view whose median error is 5 times that of all views, then each corner that is 6
// sigma off, sigma being that of the other views by the median of their errors, and then each view
// of which fewer than half of the corners, or fewer than 6, are left.
UsedCorners LeaveOutWrong(const std::vector<BoardView>& views, const LensEstimate& estimate);

}  // namespace rigcal
