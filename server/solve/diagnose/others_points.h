// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// A marker in the rig frame at a time.
struct TimedMarker {
  int marker = 0;
  int64_t rig_time_ns = 0;
  Eigen::Vector3d x_in_rig = Eigen::Vector3d::Zero();
};

// The markers of the placed instants of a line target as some of the cameras triangulate them (two
// at least and eight at most, all of which must agree): those observations of which `takes_part` is
// true. At most about `max_count`, evenly chosen, ascending by time. `instant_time_ns`: rig time,
// by instant of `problem`. `among`: of these instants, ascending, alone; null: of all.
std::vector<TimedMarker> MarkersSeenBy(
    const BundleProblem& problem, const std::vector<int64_t>& instant_time_ns,
    const std::function<bool(const BundleObservation& observation)>& takes_part, size_t max_count,
    const std::vector<size_t>* among = nullptr);

}  // namespace rigcal::server
