// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/evaluate/grouped_problem.h"

namespace rigcal::server {

// Cameras that common instants join, the largest set of them; and clocks that are seen.
struct JoinedCameras {
  std::vector<bool> camera, clock;  // by index
};

JoinedCameras JoinCameras(const BundleProblem& problem);

// The one fixed camera and each session's fixed clock must be among what is seen.
void FixWhatIsSeen(const GroupedProblem& grouped, const JoinedCameras& joined,
                   BundleProblem* problem);

}  // namespace rigcal::server
