// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// The ellipse of a blob, semi-axes `a` >= `b`, with a margin and a ring for the background.
struct MarkerAperture {
  // The margin holds what the blob's threshold left out; beyond a gap the background is read.
  static constexpr double kMarginPx = 1.75;
  static constexpr double kGapPx = 1.0;

  Eigen::Vector2d centre_px;
  Eigen::Matrix2d shape;  // x^T shape x = 1 on the blob's ellipse
  double a = 1, b = 1;    // semi-axes, px
  double ring_px = 3;     // width of the background ring

  explicit MarkerAperture(const Blob& blob) : centre_px(blob.centre_px) {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen;
    eigen.computeDirect(blob.second_moment_px2);
    // At least 1 px, because a blob of one row has no moment across it.
    const Eigen::Vector2d squared = (4 * eigen.eigenvalues()).cwiseMax(1.0);
    b = std::sqrt(squared[0]);
    a = std::sqrt(squared[1]);
    axes_ = eigen.eigenvectors();
    shape = axes_ * squared.cwiseInverse().asDiagonal() * axes_.transpose();
    ring_px = std::max(3.0, 0.35 * b);
  }

  // Returns the matrix, like `shape`, of the ellipse that lies `margin_px` outside of the blob's.
  Eigen::Matrix2d Grown(double margin_px) const {
    const Eigen::Vector2d semi(b + margin_px, a + margin_px);
    return axes_ * semi.cwiseAbs2().cwiseInverse().asDiagonal() * axes_.transpose();
  }
  // Returns the largest distance from the centre to the ring's outer edge, px.
  double Reach() const { return a + kMarginPx + kGapPx + ring_px; }
  // Falls from 1 to 0 over one pixel about the edge of `grown`; `offset` is from the centre.
  double Weight(const Eigen::Vector2d& offset, const Eigen::Matrix2d& grown) const {
    const Eigen::Vector2d g = grown * offset;
    const double rest = 1 - offset.dot(g), slope2 = g.squaredNorm();
    if (rest * rest >= slope2) return rest > 0 ? 1 : 0;
    return std::clamp(0.5 + 0.5 * rest / std::sqrt(slope2), 0.0, 1.0);
  }

 private:
  Eigen::Matrix2d axes_;
};

}  // namespace rigcal::agent
