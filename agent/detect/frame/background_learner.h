// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/container/inlined_vector.h"
#include "absl/status/statusor.h"
#include "agent/detect/blobs/static_background.h"
#include "agent/identify/detection.h"

namespace rigcal::agent {

// Learns the static background of a camera from the frames that its detector searches, except for
// the wand that is found in them. A wand that rests stays in use for three times as long as another
// spot; then it becomes background too, because it may just as well be three lamps. It is found
// again as soon as it moves by a part of its spheres' width. One thread at a time.
class BackgroundLearner {
 public:
  // `after_s`, above 0: how long a spot must stay where it is to become background. Fails with
  // INVALID_ARGUMENT as StaticBackground::Create does.
  static absl::StatusOr<BackgroundLearner> Create(const ColourRange& colour,
                                                  const ImageSize& size_px, double after_s);

  // To be given to WandDetector::SetBackground; lives as long as the learner.
  StaticBackground* background() { return background_.get(); }

  // Call before an image is searched: a resting wand that has moved stops being background.
  void Look(const ImageView& image);
  // Call after the image was searched; images come in the order of their times.
  void Learn(const ImageView& image, const Detection& detection);

  // Whether a wand is background now because it rests, and how long one must rest for that.
  bool ignores_wand() const { return ignores_wand_; }
  double rest_s() const { return rest_s_; }
  double share() const;  // of the image that is background, 0 to 1

 private:
  using Boxes = absl::InlinedVector<PixelRect, 3>;  // around each marker

  BackgroundLearner(StaticBackground background, const ImageSize& size_px, double after_s);
  static Boxes BoxesOf(const Detection& detection);
  bool Rests(const Observation& now);

  std::unique_ptr<StaticBackground> background_;
  ImageSize size_px_;
  double after_s_, rest_s_;
  std::optional<Observation> anchor_;  // the wand when it last moved
  std::vector<Boxes> resting_;
  bool ignores_wand_ = false;
};

}  // namespace rigcal::agent
