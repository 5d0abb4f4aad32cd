// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/local_plane.h"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr size_t kLeastPoints = 4;
// Of the least to the largest eigenvalue of the normal equations: below it the points are on a
// line.
constexpr double kLeastCondition = 1e-7;

// Moves the middle of points to 0 and their mean distance from it to sqrt 2.
Eigen::Matrix3d Normaliser(const std::vector<Eigen::Vector2d>& points) {
  const auto count = static_cast<double>(points.size());
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point : points) middle += point / count;
  double distance = 0;
  for (const Eigen::Vector2d& point : points) distance += (point - middle).norm() / count;
  const double scale = distance > 0 ? std::numbers::sqrt2 / distance : 1;
  Eigen::Matrix3d normaliser = Eigen::Matrix3d::Identity();
  normaliser.topLeftCorner<2, 2>() *= scale;
  normaliser.topRightCorner<2, 1>() = -scale * middle;
  return normaliser;
}

}  // namespace

std::optional<LocalPlane> LocalPlane::Through(const std::vector<PatternPixel>& points) {
  if (points.size() < kLeastPoints) return std::nullopt;
  std::vector<Eigen::Vector2d> metres, pixels;
  for (const auto& [metre, pixel] : points) {
    metres.push_back(metre);
    pixels.push_back(pixel);
  }
  const Eigen::Matrix3d from = Normaliser(metres), to = Normaliser(pixels);
  using Row = Eigen::Matrix<double, 8, 1>;
  Eigen::Matrix<double, 8, 8> information = Eigen::Matrix<double, 8, 8>::Zero();
  Row right = Row::Zero();
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d a = (from * metres[i].homogeneous()).head<2>();
    const Eigen::Vector2d b = (to * pixels[i].homogeneous()).head<2>();
    Row u, v;
    u << a.x(), a.y(), 1, 0, 0, 0, -b.x() * a.x(), -b.x() * a.y();
    v << 0, 0, 0, a.x(), a.y(), 1, -b.y() * a.x(), -b.y() * a.y();
    information += u * u.transpose() + v * v.transpose();
    right += b.x() * u + b.y() * v;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 8, 8>> eigen(information);
  if (!(eigen.eigenvalues()[0] > kLeastCondition * eigen.eigenvalues()[7])) return std::nullopt;
  const Row h = eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() *
                eigen.eigenvectors().transpose() * right;
  Eigen::Matrix3d normalised;
  normalised << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1;
  const Eigen::Matrix3d plane = to.inverse() * normalised * from;
  if (!plane.allFinite()) return std::nullopt;
  return LocalPlane(plane);
}

Eigen::Matrix2d LocalPlane::SlopeAt(const Eigen::Vector2d& pattern_m) const {
  const Eigen::Vector3d at = img_from_pattern_ * pattern_m.homogeneous();
  const Eigen::Vector2d pixel = at.hnormalized();
  return (img_from_pattern_.topLeftCorner<2, 2>() -
          pixel * img_from_pattern_.bottomLeftCorner<1, 2>()) /
         at.z();
}

LocalPlane LocalPlane::Moved(const Eigen::Vector2d& by_px) const {
  Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
  shift.topRightCorner<2, 1>() = by_px;
  return LocalPlane(shift * img_from_pattern_);
}

}  // namespace rigcal::agent
