// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/associate/align_clocks.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// The camera's observation with a marker in this instant; none: null.
const BundleObservation* ObservationBy(const BundleProblem& problem, const BundleInstant& instant,
                                       int camera);

// Instants in which two cameras, or one alone (on the diagonal), have an observation that `counts`.
std::vector<std::vector<int>> CountShared(
    const BundleProblem& problem,
    const std::function<bool(const BundleInstant&, const BundleObservation&)>& counts);

// For error messages: where in their images two cameras saw the target at the same time, so that
// one knows where to go on waving. "both saw it in the left of a's image (12 x 9 degrees) and in
// the lower right of b's (7 x 5 degrees)". Empty where they share nothing.
std::string DescribeSharedViews(const BundleProblem& problem, int a, int b);

// For error messages: the cameras that have fewer than `min_views` observations with a marker that
// is part of the cost, each with the camera it shares most instants with and what to do. Empty
// where every camera has enough.
std::string DescribeLostCameras(const BundleProblem& problem, int min_views);

// For error messages: the two cameras whose wand views come nearest in time, and how near. Empty
// where no two cameras of a session saw it. `rig_time_ns` by track and observation.
std::string DescribeNearestViews(const std::vector<AlignedTrack>& tracks,
                                 const std::vector<std::vector<int64_t>>& rig_time_ns);

}  // namespace rigcal::server
