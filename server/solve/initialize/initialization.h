// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

inline constexpr double kAgreePx = 3;  // markers this near agree with a pose

struct InitializationOptions {
  uint32_t seed = 0;  // of every random choice
  // Pairs of cameras (a < b) that misled an earlier initialization: other paths through the rig are
  // taken where there are any, else the pair's next best pose. Once for each time listed.
  std::vector<std::pair<int, int>> avoided_pairs;
  std::vector<std::string> camera_notes;  // for error messages
  std::function<void(double fraction)> progress;
  const std::atomic<bool>* cancelled = nullptr;
};

// Finds initial poses of all cameras and all instants: relative poses over the spanning tree
// of the overlap graph, chained from the camera whose pose is fixed (and stays as it is), then a
// robust bundle adjustment over some of the instants. A target of one marker has no size: its poses
// have the problem's `distance`, or, where it has none, the farthest camera from the fixed one is
// put at distance 1 and the problem's `distance` says so. Instants whose target cannot be placed
// are marked not used. `tree`, if given, becomes the pairs the poses were chained over (none of a
// target of one marker).
//
// FAILED_PRECONDITION: the cameras are not connected (names the groups, the pair that would best
// join them; of one marker, which cameras have to see it at once), or a camera does not agree with
// the others. CANCELLED.
absl::Status FindInitialization(const InitializationOptions& options, BundleProblem* problem,
                                std::vector<std::pair<int, int>>* tree = nullptr);

// Places the target in every instant again from the cameras' poses, keeping the better of the old
// and the new pose; an old one that agrees with every marker is not looked at again. Returns the
// number of instants that have one; the others are not used.
int PlaceInstants(double threshold_px, BundleProblem* problem);

}  // namespace rigcal::server
