// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/blob_contrast.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr int kDirections = 16;
constexpr int kEnough = 11;          // of them must differ; a neighbour or a lamp may hide some
constexpr double kBeyondPx = 2.5;    // from the ellipse to where the surroundings are read
constexpr double kCoreShare = 0.45;  // the middle is read at this share of the semi-axes

// Unit vectors in the frame of the blob's axes; every fourth one lies along an axis.
struct Directions {
  std::array<Eigen::Vector2d, kDirections> unit;
  Directions() {
    for (size_t i = 0; i < unit.size(); ++i) {
      const double angle = 2 * std::numbers::pi * static_cast<double>(i) / kDirections;
      unit[i] = {std::cos(angle), std::sin(angle)};
    }
  }
};

// Reads the mean of 2 x 2 pixels, as single ones are too noisy; false outside of the image.
bool Read(const ImageView& image, const Eigen::Vector2d& at, Eigen::Vector3f* grey) {
  if (image.width < 2 || image.height < 2) return false;
  if (!(at.x() > -0.5 && at.y() > -0.5)) return false;
  if (!(at.x() < image.width - 0.5 && at.y() < image.height - 0.5)) return false;
  const int x = std::clamp(static_cast<int>(at.x()), 0, image.width - 2);
  const int y = std::clamp(static_cast<int>(at.y()), 0, image.height - 2);
  const int bytes = BytesPerPixel(image.format);
  const uint8_t* const upper = image.Row(y) + x * bytes;
  const uint8_t* const lower = image.Row(y + 1) + x * bytes;
  for (int k = 0; k < 3; ++k) {
    const int sum = k < bytes ? upper[k] + upper[k + bytes] + lower[k] + lower[k + bytes] : 0;
    (*grey)[k] = 0.25f * static_cast<float>(sum);
  }
  return true;
}

}  // namespace

std::optional<BlobContrast> StandsOut(const ImageView& image, const Blob& blob,
                                      double min_contrast_grey) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen;
  eigen.computeDirect(blob.second_moment_px2);
  const Eigen::Vector2d semi = (4 * eigen.eigenvalues()).cwiseMax(0.25).cwiseSqrt();
  static const Directions kUnits;
  const auto at = [&](int direction, double share, double beyond_px) {
    const Eigen::Vector2d& unit = kUnits.unit[static_cast<size_t>(direction)];
    const Eigen::Vector2d along = (share * semi.array() + beyond_px) * unit.array();
    return Eigen::Vector2d(blob.centre_px + eigen.eigenvectors() * along);
  };
  Eigen::Vector3f core = Eigen::Vector3f::Zero(), grey;
  int count = 0;
  for (int i = 0; i < 4; ++i) {
    if (!Read(image, at(kDirections / 4 * i, kCoreShare, 0), &grey)) continue;
    core += grey;
    ++count;
  }
  if (count == 0) return std::nullopt;
  core /= static_cast<float>(count);
  Eigen::Vector3f around = Eigen::Vector3f::Zero();
  int different = 0, inside = 0;
  for (int i = 0; i < kDirections; ++i) {
    if (!Read(image, at(i, 1, kBeyondPx), &grey)) {
      ++different;  // nothing is known outside of the image, so it does not count against the blob
      continue;
    }
    around += grey;
    ++inside;
    different += (core - grey).norm() >= static_cast<float>(min_contrast_grey) ? 1 : 0;
  }
  if (different < kEnough) return std::nullopt;
  if (inside > 0) around /= static_cast<float>(inside);
  return BlobContrast{core, around, 1 - static_cast<float>(different) / kDirections};
}

}  // namespace rigcal::agent
