// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/disc_pair.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr double kLeastRatio = 1.4;  // of the second moments; 1 is a disc
// Radii between the centres; closer ones hide two fifths of each other, and what moves looks alike.
constexpr double kLeastApart = 0.95;
constexpr double kMostRatio = 5.6;  // two discs that touch have 5
constexpr int kBisections = 16;

// The union of two discs of radius 1 whose centres are 2 cos(angle) apart.
struct DiscUnion {
  double area = 0, along = 0, across = 0;  // second moments about its middle
};

// Each half is a disc without the segment beyond the line through the two points where the circles
// meet. Moments of a segment of half angle p about the disc's centre: area p - sin p cos p, first
// 2/3 sin^3 p, second along the axis (p - sin p cos p + 2 sin^3 p cos p) / 4, across it
// (3 p - 3 sin p cos p - 2 sin^3 p cos p) / 12: integrals of 2 sqrt(1 - u^2) and its powers.
DiscUnion UnionAt(double angle) {
  const double sine = std::sin(angle), cosine = std::cos(angle), cube = sine * sine * sine;
  const double segment = angle - sine * cosine, apart = cosine;  // half of it
  const double half = std::numbers::pi - segment;
  const double along = half * apart * apart + std::numbers::pi / 4 -
                       0.25 * (segment + 2 * cube * cosine) + 2 * apart * (2.0 / 3) * cube;
  const double across = std::numbers::pi / 4 - (3 * segment - 2 * cube * cosine) / 12;
  return {2 * half, along / half, across / half};
}

}  // namespace

double Elongation(const Blob& blob) {
  const Eigen::Matrix2d second = blob.second_moment_px2 + Eigen::Matrix2d::Identity() / 12;
  const double half = 0.5 * second.trace();
  const double root = std::sqrt(std::max(0.0, half * half - second.determinant()));
  return std::sqrt((half + root) / std::max(1e-9, half - root)) - 1;
}

std::optional<std::array<Blob, 2>> SplitPair(const Blob& blob) {
  const Eigen::Matrix2d own = Eigen::Matrix2d::Identity() / 12;  // a pixel's extent
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen;
  eigen.computeDirect(blob.second_moment_px2 + own);
  const double across = eigen.eigenvalues()[0], along = eigen.eigenvalues()[1];
  if (!(across > 0) || along < kLeastRatio * across || along > kMostRatio * across) {
    return std::nullopt;
  }
  // The further apart, the longer.
  double low = 0, high = 0.5 * std::numbers::pi;
  for (int i = 0; i < kBisections; ++i) {
    const double angle = 0.5 * (low + high);
    const DiscUnion both = UnionAt(angle);
    (both.along > along / across * both.across ? low : high) = angle;
  }
  const double angle = 0.5 * (low + high);
  if (2 * std::cos(angle) < kLeastApart) return std::nullopt;
  const double radius = std::sqrt(blob.area_px / UnionAt(angle).area);
  std::array<Blob, 2> discs;
  for (const int side : {0, 1}) {
    Blob& disc = discs[static_cast<size_t>(side)];
    const Eigen::Vector2d away = radius * std::cos(angle) * eigen.eigenvectors().col(1);
    disc.centre_px = blob.centre_px + (side == 0 ? -away : away);
    disc.second_moment_px2 = 0.25 * radius * radius * Eigen::Matrix2d::Identity() - own;
    disc.area_px = static_cast<int>(std::lround(std::numbers::pi * radius * radius));
    const Eigen::Vector2d corner = disc.centre_px.array() - radius;
    const int side_px = static_cast<int>(std::ceil(2 * radius));
    disc.box = {static_cast<int>(std::floor(corner.x())), static_cast<int>(std::floor(corner.y())),
                side_px, side_px};
    disc.touches_border = blob.touches_border;
  }
  return discs;
}

}  // namespace rigcal::agent
