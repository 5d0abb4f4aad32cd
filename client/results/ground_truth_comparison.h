// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/simulation/world/simulated_world.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

// How far a calibration of a simulated rig is from the truth. Cameras are matched by name
// (SimulatedCamera::description), poses after the rigid alignment of AlignRigidly, or, where the
// calibration's scale is not known, the similarity that fits best, whose factor is then
// `unit_length_m`; a camera's time offset error is estimated minus true, both at the camera's
// time_epoch_s and each against the median over the cameras compared.
//
// FAILED_PRECONDITION: the calibration has no result. INVALID_ARGUMENT: a camera
// is none of the world's, or has no pose.
absl::StatusOr<rigcal::v1::TruthComparison> CompareWithGroundTruth(
    const rigcal::v1::Calibration& calibration, const SimulatedWorld& world);

}  // namespace rigcal::client
