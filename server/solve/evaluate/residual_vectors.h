// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/calibration/calibration.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

struct ResidualVectorLimits {
  size_t inliers_per_camera = 500;
  size_t outliers_per_camera = 150;
  size_t total = 60'000;  // with many cameras each gets fewer
};

// Residuals of the markers of the used instants, camera by camera of the problem; image sizes are
// left to the caller. Vectors are taken at even steps through the recording, inliers and outliers
// each by themselves, so that the same problem always gives the same ones. Markers that their
// camera cannot see have no residual.
std::vector<CameraResiduals> CollectResiduals(const BundleProblem& problem,
                                              const ResidualVectorLimits& limits = {});

}  // namespace rigcal::server
