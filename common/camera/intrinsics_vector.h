// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "common/camera/intrinsics.h"
#include "common/camera/projection.h"

namespace rigcal {

// fx fy cx cy, then the coefficients of the distortion model in OpenCV's order.
using IntrinsicsVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxIntrinsics, 1>;
// d pixel / d IntrinsicsVector.
using IntrinsicsJacobian =
    Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, kMaxIntrinsics>;

// Number of values of an IntrinsicsVector of this model: 9, 12 or 8.
int IntrinsicsSize(DistortionModel model);
// The distortion may be empty: zeros.
IntrinsicsVector ToVector(const Intrinsics& intrinsics);
Intrinsics FromVector(DistortionModel model, const IntrinsicsVector& values);

}  // namespace rigcal
