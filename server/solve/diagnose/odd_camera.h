// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "common/calibration/finding_kind.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// What is wrong with one camera, whose rows agree with no pose among the others, or badly.
struct OddCamera {
  std::string camera;  // empty: no single camera is to blame
  FindingKind kind =
      FindingKind::kUnspecified;  // mirrored_image, noisy_camera, inconsistent_camera
  double error_px = 0;            // median, of the best pose
  double mirrored_px = 0;         // median, of the best pose for the mirrored image
  std::string advice;
};

// Tests one camera against what the solution's other cameras have triangulated: whether any pose
// fits its rows, at any offset within 0.5 s, as they are or mirrored. kUnspecified: it fits well,
// or there is too little to tell.
OddCamera JudgeCamera(const RigObservations& rig, const RigSolution& solution,
                      const std::string& camera);

// The rig without one of its cameras (by index), and the clocks of what remains.
RigObservations WithoutCamera(const RigObservations& rig,
                              const std::vector<ClockCorrection>& clocks, size_t camera,
                              std::vector<ClockCorrection>* remaining);

// For a rig that cannot be solved: solves it without each of its cameras in turn (of at most 10, in
// rigs of at least four), and judges the first one without which the others agree.
OddCamera FindOddCamera(const RigObservations& rig, const std::vector<ClockCorrection>& clocks,
                        const RigSolveOptions& options);

}  // namespace rigcal::server
