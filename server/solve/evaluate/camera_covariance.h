// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "common/calibration/calibration.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/evaluate/uncertainty.h"

namespace rigcal::server {

// The shape's covariance in the form of CalibrationResult::camera_covariance. Parameters that were
// held fixed, or that no marker touches, have zeros.
std::vector<double> PackCameraCovariance(const BundleProblem& problem, int reference_camera,
                                         const RigUncertainty& uncertainty);

// The volume of the ends of the placed target; none if none was placed.
std::optional<WandVolume> MeasureWandVolume(const BundleProblem& problem);

}  // namespace rigcal::server
