// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/results/rigid_alignment.h"
#include "common/simulation/world/simulated_world.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

// Errors of a calibration of a simulated rig.
struct GroundTruthComparison {
  struct Camera {
    std::string camera;
    PoseDifference error;            // of the camera centres and the orientations
    double time_offset_error_s = 0;  // estimated minus true, each against its median clock
  };
  std::vector<Camera> cameras;  // in the calibration's order
  PoseDifference max_error;
  double unit_length_m = 0;             // found by the alignment; 0: the scale was known
  std::optional<double> point_error_m;  // true_point_error.h
};

// Compares a calibration of a simulated rig with ground truth. Cameras are matched by name
// (SimulatedCamera::description), poses after the rigid alignment of AlignRigidly, or, where the
// calibration's scale is not known, the similarity that fits best, whose factor is then
// `unit_length_m`; a camera's time offset error is taken at the camera's time_epoch_s, against the
// median over the cameras compared.
//
// FAILED_PRECONDITION: the calibration has no result. INVALID_ARGUMENT: a camera is none of the
// world's, or has no pose.
absl::StatusOr<GroundTruthComparison> CompareWithGroundTruth(
    const rigcal::v1::Calibration& calibration, const SimulatedWorld& world);

// For people: a table of the errors and a line of how they were found.
std::string FormatGroundTruthErrors(const GroundTruthComparison& comparison);

// A calibration as ToJson writes it, with the comparison, where there is one, as "ground_truth".
std::string CalibrationJson(const rigcal::v1::Calibration& calibration,
                            const GroundTruthComparison* comparison);

}  // namespace rigcal::client
