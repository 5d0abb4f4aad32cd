// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "absl/types/span.h"
#include "agent/event/event_words.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

// A marker that is seen whole.
struct SeenMarker {
  MarkerSight sight;
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  int kind = 0;  // as in WandFinderOptions::marker_kinds
};

// Two markers of a wand of three.
struct EnteringPair {
  std::array<int, 2> markers = {0, 0};                 // of the two that are seen
  int other = 0;                                       // marker
  bool is_in_lens = false;                             // the other one: within what the lens sees
  Eigen::Vector2d other_px = Eigen::Vector2d::Zero();  // then: where it is
  double other_radius_px = 0;
  WandImageFit fit;  // of the whole wand
};

// Which two markers of a wand of three these are while it comes into the image. By the sizes of the
// two and their distance few of the six ways are possible, and each says where the third one is.
// It must be beyond the border, or cut by it; there are no other reasons for which it may be
// missing. None: there are several ways or none, or the wand points along the line of sight, where
// the length says little, or the diameter is not known. `kinds`: by marker; empty: all the same.
std::optional<EnteringPair> FindEnteringPair(const WandFinder& finder,
                                             const SensorGeometry& geometry,
                                             absl::Span<const int> kinds,
                                             const std::array<SeenMarker, 2>& seen);

}  // namespace rigcal::agent
