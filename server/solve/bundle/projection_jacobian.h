// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/camera/intrinsics.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// d pixel / d (fx fy cx cy coefficients); 4 + CoefficientCount(model) columns.
using IntrinsicsJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, 12>;

// Number of values of an IntrinsicsVector of this model: 9, 12 or 8.
int IntrinsicsSize(DistortionModel model);
IntrinsicsVector ToVector(const Intrinsics& intrinsics);
Intrinsics FromVector(DistortionModel model, const IntrinsicsVector& values);
// Of each camera of a problem, by index.
std::vector<Intrinsics> CurrentIntrinsics(const BundleProblem& problem);

// The projection of common/camera/camera_model.h with its derivatives, for the inner loop of a
// solver: intrinsics as IntrinsicsSize(model) plain values. `d_point` (d pixel / d x_in_cam) and
// `d_intrinsics` may be null. False for a point that the model cannot see (z <= 0, a pole of the
// rational model, not finite); outputs are then unspecified.
bool ProjectWithJacobian(DistortionModel model, const double* intrinsics,
                         const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* pixel,
                         Eigen::Matrix<double, 2, 3>* d_point, IntrinsicsJacobian* d_intrinsics);

}  // namespace rigcal::server
