// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace rigcal::server {

// Two views of one point, normalised coordinates (z = 1).
struct RayPair {
  Eigen::Vector2d a = Eigen::Vector2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
};

// Every real essential matrix E with x_b^T E x_a = 0 for five points, each of norm 1; ten at most.
// Five points leave four matrices whose combinations x E1 + y E2 + z E3 + E4 fit; the nine
// equations 2 E E^T E = trace(E E^T) E and det E = 0 are ten cubic polynomials in x, y, z. Their
// solutions are eigenvectors of the matrix by which x multiplies the ten lower monomials
// (Stewenius, Engels and Nister 2006, "Recent developments on direct relative orientation"). Not
// five pairs, or points that determine no such combination: none.
std::vector<Eigen::Matrix3d> EssentialsOfFivePoints(std::span<const RayPair> five);

}  // namespace rigcal::server
