// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"

namespace rigcal {

// A direction in frame `cam` (any length, z > 0) and the pixel that shows it.
struct RayPixel {
  Eigen::Vector3d direction;
  Eigen::Vector2d pixel;
};

struct IntrinsicsFit {
  Intrinsics intrinsics;
  double rms_px = 0;  // of the distances that remain
};

// The intrinsics of `model` that show `rays` where they were seen, by least squares (Levenberg and
// Marquardt; Nocedal and Wright, Numerical Optimization, section 10.3), from the focal lengths,
// principal point and, of the same family, the coefficients of `start`. For describing a lens that
// is known in one model by another.
// `basis`, where it has elements, says which intrinsics there are: values = basis * free values, as
// for one focal length for both axes, or none of some coefficients.
// INVALID_ARGUMENT: fewer rays than the model has parameters. FAILED_PRECONDITION: no such
// intrinsics were found.
absl::StatusOr<IntrinsicsFit> FitIntrinsics(DistortionModel model,
                                            const std::vector<RayPixel>& rays,
                                            const Intrinsics& start,
                                            const Eigen::MatrixXd& basis = {});

}  // namespace rigcal
