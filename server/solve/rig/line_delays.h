// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Rolling shutters: a marker in image row y of a camera is seen at
//   stamp of the observation + line_delay_s * (y - (height - 1) / 2)
// so that the line delay leaves the clock's offset, which is that of the middle row, as it is.
struct LineDelay {
  double line_delay_s = 0;  // from one row to the next; negative where they are read upwards
  double sigma_s = 0;       // one sigma, of independent errors; infinite: nothing is known
};

// What the line delays of all cameras still are, by camera of a solved problem: an adjustment of
// everything that the problem leaves free, and of them; of those of `without` (by camera; empty:
// none) nothing is known, they stay as they are. Instants of about `max_markers` markers are used,
// of those that `use` wants (by index; none: all).
//
// Errors as of AdjustBundle and ComputeInformation. FAILED_PRECONDITION: not determined by the
// data.
absl::StatusOr<std::vector<LineDelay>> EstimateLineDelays(
    const BundleProblem& solved, size_t max_markers, const std::vector<bool>& without,
    const std::function<bool(size_t instant)>& use, const std::atomic<bool>* cancelled);

// By camera: its line delay should be estimated. Empty: no camera has one that stands out, by 8
// sigma and two milliseconds over the image, and is the same in the first and the second half of
// the instants, each with poses of its own: what a camera that moved leaves behind is not. Once one
// has, all those are estimated that are not known to have none, but for those of `without`.
//
// Errors as of EstimateLineDelays.
absl::StatusOr<std::vector<bool>> FindRollingShutters(const BundleProblem& solved,
                                                      const std::vector<int>& heights_px,
                                                      const std::vector<bool>& without,
                                                      const std::atomic<bool>* cancelled,
                                                      std::vector<LineDelay>* delays);

}  // namespace rigcal::server
