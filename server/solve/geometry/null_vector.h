// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace rigcal::server {

inline constexpr int kMaxNullVectorSize = 12;

// The unit vector x that minimises x^T normal x: the solution of homogeneous equations A x = 0 with
// normal = A^T A (Hartley and Zisserman, Multiple View Geometry, A5.3). `normal` is symmetric, of
// at most kMaxNullVectorSize rows; only its lower triangle is read. The sign is arbitrary.
// Compiled once for every size: Eigen's solver takes several seconds to compile for each.
Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxNullVectorSize, 1> NullVector(
    const Eigen::Ref<const Eigen::MatrixXd>& normal);

}  // namespace rigcal::server
