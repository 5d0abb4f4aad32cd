// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/ray_grid.h"

#include <Eigen/Geometry>
#include <cstddef>
#include <limits>

#include "common/camera/camera_model.h"

namespace rigcal {

absl::StatusOr<RayGrid> RayGrid::Create(const Intrinsics& intrinsics, const ImageSize& image_size) {
  RayGrid grid;
  grid.columns_ = static_cast<int>(image_size.width) / kStep + 2;
  const int rows = static_cast<int>(image_size.height) / kStep + 2;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  grid.nodes_.assign(static_cast<size_t>(grid.columns_) * static_cast<size_t>(rows),
                     Eigen::Vector3d::Constant(kNone));
  bool any = false;
  size_t node = 0;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < grid.columns_; ++column, ++node) {
      const auto direction = Undistort(
          intrinsics, {static_cast<double>(kStep * column), static_cast<double>(kStep * row)});
      if (!direction.ok()) continue;
      grid.nodes_[node] = direction->homogeneous().normalized();
      any = true;
    }
  }
  if (any) return grid;
  return absl::InvalidArgumentError("the lens model gives no pixel of the image a direction");
}

void RayGrid::Row(int x, int y, int count, Eigen::Vector3d* rays) const {
  const Eigen::Vector3d* upper = &nodes_[static_cast<size_t>(y / kStep * columns_)];
  const Eigen::Vector3d* lower = upper + columns_;
  const double down = static_cast<double>(y % kStep) / kStep;
  for (int i = 0; i < count; ++i) {
    const int cell = (x + i) / kStep;
    const double right = static_cast<double>((x + i) % kStep) / kStep;
    rays[i] = (1 - down) * ((1 - right) * upper[cell] + right * upper[cell + 1]) +
              down * ((1 - right) * lower[cell] + right * lower[cell + 1]);
  }
}

}  // namespace rigcal
