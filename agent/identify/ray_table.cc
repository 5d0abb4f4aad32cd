// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/ray_table.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "common/camera/camera_model.h"

namespace rigcal::agent {
namespace {

constexpr int kLeastCellPx = 32, kMostCells = 64;  // along the longer side
constexpr int kBeyondCells = 2;      // on each side of the image, for markers that the border cuts
constexpr double kMostStepPx = 0.1;  // Newton's step; the error that it leaves goes with its square

}  // namespace

RayTable::RayTable(const Intrinsics& intrinsics, const ImageSize& image_size_px)
    : intrinsics_(intrinsics),
      cell_px_(std::max(
          kLeastCellPx,
          static_cast<int>(std::max(image_size_px.width, image_size_px.height)) / kMostCells)),
      columns_(static_cast<int>(image_size_px.width) / cell_px_ + 2 + 2 * kBeyondCells),
      rows_(static_cast<int>(image_size_px.height) / cell_px_ + 2 + 2 * kBeyondCells) {
  std::vector<bool> has_ray;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const auto ray =
          Undistort(intrinsics_, {static_cast<double>((column - kBeyondCells) * cell_px_),
                                  static_cast<double>((row - kBeyondCells) * cell_px_)});
      has_ray.push_back(ray.ok());
      nodes_.push_back(ray.ok() ? *ray : Eigen::Vector2d::Zero());
    }
  }
  is_inside_.assign(nodes_.size(), false);
  for (int row = 0; row + 1 < rows_; ++row) {
    for (int column = 0; column + 1 < columns_; ++column) {
      const auto at = static_cast<size_t>(row * columns_ + column);
      const size_t below = at + static_cast<size_t>(columns_);
      is_inside_[at] = has_ray[at] && has_ray[at + 1] && has_ray[below] && has_ray[below + 1];
    }
  }
}

int RayTable::CellOf(const Eigen::Vector2d& pixel, Eigen::Vector2d* share) const {
  const Eigen::Vector2d cells = pixel / cell_px_ + Eigen::Vector2d::Constant(kBeyondCells);
  // NaN lies in no cell.
  if (!(cells.x() >= 0 && cells.y() >= 0 && cells.x() < columns_ - 1 && cells.y() < rows_ - 1)) {
    return -1;
  }
  const int column = static_cast<int>(cells.x()), row = static_cast<int>(cells.y());
  *share = {cells.x() - column, cells.y() - row};
  const int cell = row * columns_ + column;
  return is_inside_[static_cast<size_t>(cell)] ? cell : -1;
}

bool RayTable::HasRay(const Eigen::Vector2d& pixel) const {
  Eigen::Vector2d share;
  return CellOf(pixel, &share) >= 0 || Undistort(intrinsics_, pixel).ok();
}

bool RayTable::RayOf(const Eigen::Vector2d& pixel, Eigen::Vector2d* normalised,
                     Eigen::Matrix<double, 2, 3>* d_pixel_d_point) const {
  Eigen::Vector2d share, seen_px;
  const int cell = CellOf(pixel, &share);
  if (cell >= 0) {
    const Eigen::Vector2d* const above = &nodes_[static_cast<size_t>(cell)];
    const Eigen::Vector2d* const below = above + columns_;
    *normalised = (1 - share.y()) * ((1 - share.x()) * above[0] + share.x() * above[1]) +
                  share.y() * ((1 - share.x()) * below[0] + share.x() * below[1]);
    // One step of Newton's method corrects the interpolated ray.
    if (Project(intrinsics_, normalised->homogeneous(), &seen_px, d_pixel_d_point)) {
      const Eigen::Vector2d off_px = pixel - seen_px;
      const Eigen::Matrix2d derivative = d_pixel_d_point->leftCols<2>();
      *normalised += derivative.inverse() * off_px;
      if (off_px.norm() < kMostStepPx) return true;
    }
  }
  const auto exact = Undistort(intrinsics_, pixel);
  if (!exact.ok()) return false;
  *normalised = *exact;
  return Project(intrinsics_, exact->homogeneous(), &seen_px, d_pixel_d_point);
}

}  // namespace rigcal::agent
