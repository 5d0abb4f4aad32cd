// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/expected_error.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr double kLowShare = 0.01, kHighShare = 0.99;  // of the waved volume
constexpr double kMinStepM = 0.02;
constexpr double kMaxRoundTrip = 1e-6;

// Of one camera. First column of each part of the pose; -1: it is fixed.
struct Columns {
  Eigen::Index rotation = -1, translation = -1;
  std::vector<std::pair<Eigen::Index, int>> intrinsics;  // column and component
};

std::vector<Columns> ColumnsByCamera(const std::vector<ReducedParameter>& parameters,
                                     size_t camera_count) {
  std::vector<Columns> columns(camera_count);
  for (size_t i = 0; i < parameters.size(); ++i) {
    const ReducedParameter& parameter = parameters[i];
    const auto column = static_cast<Eigen::Index>(i);
    const auto index = static_cast<size_t>(parameter.index);
    if (parameter.kind == ReducedParameterKind::kIntrinsic) {
      columns[index].intrinsics.emplace_back(column, parameter.component);
    }
    if (parameter.component != 0) continue;
    if (parameter.kind == ReducedParameterKind::kRotation) columns[index].rotation = column;
    if (parameter.kind == ReducedParameterKind::kTranslation) columns[index].translation = column;
  }
  return columns;
}

// The pixel's derivatives by the point and by the camera; false where the camera does not see it.
bool Linearise(const BundleCamera& camera, const Intrinsics& intrinsics, const ImageSize& size,
               const Eigen::Vector3d& point_m, Eigen::Matrix<double, 2, 3>* d_point,
               Eigen::Matrix<double, 2, 6>* d_pose, IntrinsicsJacobian* d_intrinsics) {
  const Eigen::Vector3d rotated = camera.cam_from_rig.rotation * point_m;
  const Eigen::Vector3d x_in_cam = rotated + camera.cam_from_rig.translation_m;
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> d_cam;
  if (!Project(camera.model, camera.intrinsics.data(), x_in_cam, &pixel, &d_cam, d_intrinsics)) {
    return false;
  }
  if (!(pixel.x() >= -0.5) || !(pixel.y() >= -0.5) || !(pixel.x() < size.width - 0.5) ||
      !(pixel.y() < size.height - 0.5)) {
    return false;
  }
  // A strong distortion folds what is far outside back into the image.
  const absl::StatusOr<Eigen::Vector2d> ray = Undistort(intrinsics, pixel);
  if (!ray.ok() || (*ray - x_in_cam.head<2>() / x_in_cam.z()).norm() > kMaxRoundTrip) return false;
  *d_point = d_cam * camera.cam_from_rig.rotation.toRotationMatrix();
  Eigen::Matrix3d cross;
  cross << 0, -rotated.z(), rotated.y(), rotated.z(), 0, -rotated.x(), -rotated.y(), rotated.x(), 0;
  d_pose->leftCols<3>() = -d_cam * cross;
  d_pose->rightCols<3>() = d_cam;
  return true;
}

}  // namespace

Eigen::Vector3d WavedGrid::Point(size_t index) const {
  const std::array<int, 3> cell = Cell(index);
  return origin_m + step_m * Eigen::Vector3d(cell[0], cell[1], cell[2]);
}

std::array<int, 3> WavedGrid::Cell(size_t index) const {
  const int i = static_cast<int>(index);
  return {i % counts[0], i / counts[0] % counts[1], i / (counts[0] * counts[1])};
}

std::optional<size_t> WavedGrid::Nearest(const Eigen::Vector3d& point_m) const {
  size_t index = 0, stride = 1;
  for (int i = 0; i < 3; ++i) {
    const double position = std::round((point_m[i] - origin_m[i]) / step_m);
    const auto axis = static_cast<size_t>(i);
    if (!(position >= 0) || !(position < counts[axis])) return std::nullopt;
    index += stride * static_cast<size_t>(position);
    stride *= static_cast<size_t>(counts[axis]);
  }
  return index;
}

WavedGrid MeasureWavedGrid(const BundleProblem& problem, size_t max_points) {
  // Ends and middle of the target.
  std::vector<Eigen::Vector3d> places;
  std::array<std::vector<double>, 3> coordinates;
  const double length_m = problem.target.marker_positions_m.back();
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const double share : {0.0, 0.5, 1.0}) {
      places.push_back(instant.origin_m + share * length_m * instant.direction);
      for (int i = 0; i < 3; ++i) coordinates[static_cast<size_t>(i)].push_back(places.back()[i]);
    }
  }
  WavedGrid grid;
  if (places.empty()) return grid;
  Eigen::Vector3d low, high;
  for (size_t i = 0; i < 3; ++i) {
    low[static_cast<Eigen::Index>(i)] = LowerQuantile(&coordinates[i], kLowShare);
    high[static_cast<Eigen::Index>(i)] = UpperQuantile(&coordinates[i], kHighShare);
  }
  // As fine as `max_points` allows, with one step beyond on both sides.
  const Eigen::Vector3d size_m = high - low;
  const auto counts_at = [&size_m](double step_m) {
    return Eigen::Array3d((size_m.array() / step_m).ceil() + 3);
  };
  grid.step_m = std::max(kMinStepM, size_m.maxCoeff() / 64);
  while (counts_at(grid.step_m).prod() > static_cast<double>(max_points)) grid.step_m *= 1.05;
  const Eigen::Array3d counts = counts_at(grid.step_m);
  for (int i = 0; i < 3; ++i) grid.counts[static_cast<size_t>(i)] = static_cast<int>(counts[i]);
  grid.origin_m = 0.5 * (low + high) - 0.5 * grid.step_m * (counts - 1).matrix();
  grid.wand_counts.assign(static_cast<size_t>(counts.prod()), 0);
  for (const Eigen::Vector3d& place : places) {
    if (const auto index = grid.Nearest(place)) ++grid.wand_counts[*index];
  }
  grid.inside.assign(grid.size(), false);
  for (size_t index = 0; index < grid.size(); ++index) {
    if (grid.wand_counts[index] == 0) continue;
    const std::array<int, 3> cell = grid.Cell(index);
    for (int neighbour = 0; neighbour < 27; ++neighbour) {
      const int x = cell[0] + neighbour % 3 - 1, y = cell[1] + neighbour / 3 % 3 - 1,
                z = cell[2] + neighbour / 9 - 1;
      if (x < 0 || y < 0 || z < 0 || x >= grid.counts[0] || y >= grid.counts[1] ||
          z >= grid.counts[2]) {
        continue;
      }
      grid.inside[static_cast<size_t>(x + grid.counts[0] * (y + grid.counts[1] * z))] = true;
    }
  }
  return grid;
}

PointGains ComputeGains(const BundleProblem& problem, const std::vector<CameraDescription>& cameras,
                        const std::vector<ReducedParameter>& parameters, const WavedGrid& grid,
                        double sigma_px) {
  const std::vector<Columns> columns = ColumnsByCamera(parameters, problem.cameras.size());
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  const auto inside = static_cast<Eigen::Index>(std::ranges::count(grid.inside, true));
  PointGains gains;
  gains.gain.resize(3 * inside, static_cast<Eigen::Index>(parameters.size()));
  Eigen::Index row = 0;
  for (size_t index = 0; index < grid.size(); ++index) {
    if (!grid.inside[index]) continue;
    const Eigen::Vector3d point_m = grid.Point(index);
    int camera_count = 0;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    auto pull = gains.gain.middleRows<3>(row);
    pull.setZero();
    for (size_t c = 0; c < problem.cameras.size(); ++c) {
      Eigen::Matrix<double, 2, 3> d_point;
      Eigen::Matrix<double, 2, 6> d_pose;
      IntrinsicsJacobian d_intrinsics;
      if (!Linearise(problem.cameras[c], intrinsics[c], cameras[c].image_size_px, point_m, &d_point,
                     &d_pose, &d_intrinsics)) {
        continue;
      }
      ++camera_count;
      normal += d_point.transpose() * d_point;
      // The point moves so that the pixels stay: minus the pull of the parameters.
      const Columns& own = columns[c];
      if (own.rotation >= 0) {
        pull.middleCols<3>(own.rotation) = -d_point.transpose() * d_pose.leftCols<3>();
      }
      if (own.translation >= 0) {
        pull.middleCols<3>(own.translation) = -d_point.transpose() * d_pose.rightCols<3>();
      }
      for (const auto& [column, component] : own.intrinsics) {
        pull.col(column) = -d_point.transpose() * d_intrinsics.col(component);
      }
    }
    if (camera_count < 2) continue;
    if (!AreRaysApart(normal)) continue;
    const Eigen::Matrix3d inverse = normal.inverse();
    pull = (inverse * pull).eval();
    gains.points.push_back(index);
    gains.noise_m.push_back(sigma_px * std::sqrt(inverse.trace()));
    row += 3;
  }
  gains.gain.conservativeResize(row, Eigen::NoChange);
  return gains;
}

PointGains ChoosePoints(const PointGains& gains, size_t count) {
  const size_t stride = std::max<size_t>(1, (gains.points.size() + count - 1) / count);
  std::vector<size_t> chosen;
  for (size_t i = stride / 2; i < gains.points.size(); i += stride) chosen.push_back(i);
  PointGains subset;
  subset.gain.resize(static_cast<Eigen::Index>(3 * chosen.size()), gains.gain.cols());
  for (size_t i = 0; i < chosen.size(); ++i) {
    subset.points.push_back(gains.points[chosen[i]]);
    subset.noise_m.push_back(gains.noise_m[chosen[i]]);
    subset.gain.middleRows<3>(static_cast<Eigen::Index>(3 * i)) =
        gains.gain.middleRows<3>(static_cast<Eigen::Index>(3 * chosen[i]));
  }
  return subset;
}

std::vector<Eigen::Vector3d> PlacesOf(const PointGains& gains, const WavedGrid& grid) {
  std::vector<Eigen::Vector3d> points_m;
  for (const size_t index : gains.points) points_m.push_back(grid.Point(index));
  return points_m;
}

ExpectedError ComputeExpectedError(PointGains gains, const Eigen::MatrixXd& covariance,
                                   const WavedGrid& grid) {
  ExpectedError error;
  if (gains.points.empty()) return error;
  CalibrationError figures =
      ComputeCalibrationError(PlacesOf(gains, grid), std::move(gains.gain), covariance);
  error.points = std::move(gains.points);
  error.sigma_m = std::move(figures.sigma_m);
  error.median_m = figures.median_m;
  error.p95_m = figures.p95_m;
  error.p95_bound_m = figures.p95_bound_m;
  const auto worst = std::ranges::max_element(error.sigma_m);
  error.worst_m = *worst;
  error.worst_point = error.points[static_cast<size_t>(worst - error.sigma_m.begin())];
  error.noise_median_m = UpperMedian(gains.noise_m);
  return error;
}

}  // namespace rigcal::server
