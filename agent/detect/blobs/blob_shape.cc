// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/blob_shape.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr double kMostElongation = 0.6;  // of a sphere that moves during the exposure
constexpr double kLeastFill = 0.9;  // area over that of the ellipse with the same second moment

// Adds a pixel's own extent, 1/12 px^2: a blob of one row has no moment across it.
Eigen::Matrix2d SecondMoment(const Blob& blob) {
  return blob.second_moment_px2 + Eigen::Matrix2d::Identity() / 12;
}

}  // namespace

double Elongation(const Blob& blob) {
  const Eigen::Matrix2d second = SecondMoment(blob);
  const double half = 0.5 * second.trace();
  const double root = std::sqrt(std::max(0.0, half * half - second.determinant()));
  return std::sqrt((half + root) / std::max(1e-9, half - root)) - 1;
}

bool IsRound(const Blob& blob) {
  const double determinant = SecondMoment(blob).determinant();
  return determinant > 0 && Elongation(blob) < kMostElongation &&
         blob.area_px > kLeastFill * 4 * std::numbers::pi * std::sqrt(determinant);
}

}  // namespace rigcal::agent
