// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"

namespace rigcal::server {

// Every n-th used instant with its session and time; the target's lengths as they are.
struct GroupedProblem {
  BundleProblem problem;
  std::vector<int> session;    // by instant
  std::vector<double> time_s;  // by instant, since the first of its session
  std::vector<std::string> session_ids;
  std::vector<bool> is_static;  // by session: its times are made up
  std::vector<int> clock_of_camera;
  std::vector<std::vector<int>> clocks_of_session;
  size_t stride = 1;
};

// The used instants, evenly thinned out where there are more markers than are worth their time.
GroupedProblem GroupInstants(const RigObservations& rig, const RigSolution& solution);

// Without an instant that `keeps` refuses, and without a camera (-1: all stay). An instant that the
// other cameras do not place is not used.
BundleProblem Rest(const GroupedProblem& grouped, const std::function<bool(size_t)>& keeps,
                   int left_out);

}  // namespace rigcal::server
