// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/associate/camera_track.h"
#include "server/solve/diagnose/lamp_phases.h"
#include "server/solve/evaluate/evaluated_solve.h"

namespace rigcal::server {

// The clock samples that are readings of lamps (kLamps), in rig time by the solution. `tracks`: of
// the input. Left out are epochs of clocks that are not in the rig.
std::vector<LampPhases> LampPhasesOf(const std::vector<CameraTrack>& tracks,
                                     const RigObservations& rig,
                                     const EvaluatedSolution& evaluated);

}  // namespace rigcal::server
