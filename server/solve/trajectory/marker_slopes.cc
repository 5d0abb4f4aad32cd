// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/marker_slopes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/camera/camera_model.h"

namespace rigcal::server {
namespace {

constexpr double kTimeStepS = 1e-6;

const KernelColumns& ColumnsOf(const LineBundleLayout& layout,
                               const BundleObservation& observation) {
  return layout
      .columns[static_cast<size_t>(layout.ViewIndex(observation.camera, observation.clock))];
}

}  // namespace

bool DifferentiateMarker(const TrajectoryProblem& problem, const LineBundleLayout& layout,
                         size_t row, const BundleObservation& observation,
                         const BundleMarker& marker, MarkerSlopes* slopes) {
  const BundleProblem& rows = problem.rows;
  const TrajectorySpan& span = problem.spans[static_cast<size_t>(problem.span_of_row[row])];
  slopes->weights = WeightsAt(span, problem.TimeOf(observation, marker));
  const TrajectoryPose pose = PoseAt(span, slopes->weights);
  const double position_m = rows.target.marker_positions_m[static_cast<size_t>(marker.marker)];
  const BundleCamera& camera = rows.CameraOf(observation);
  const Eigen::Vector3d rotated =
      camera.cam_from_rig.rotation * (pose.origin_m + position_m * pose.direction);
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> d_point;
  IntrinsicsJacobian d_intrinsics;
  if (!Project(camera.model, camera.intrinsics.data(), rotated + camera.cam_from_rig.translation_m,
               &pixel, &d_point, &d_intrinsics)) {
    return false;
  }
  const Eigen::Matrix2d root = marker.sqrt_information;
  slopes->residual = root * (pixel - Eigen::Vector2d(marker.centre_px));
  d_point = root * d_point;
  const Eigen::Matrix<double, 2, 3> d_rig =
      d_point * camera.cam_from_rig.rotation.toRotationMatrix();
  const Eigen::Matrix<double, 2, 3> d_direction = position_m * d_rig * pose.direction_by_spline;
  slopes->knots.resize(2, 4 * span.size);
  for (Eigen::Index k = 0; k < 4; ++k) {
    slopes->knots.middleCols<3>(k * span.size) = slopes->weights.value[k] * d_rig;
    if (span.has_direction()) {
      slopes->knots.middleCols<3>(k * span.size + 3) = slopes->weights.value[k] * d_direction;
    }
  }
  const Eigen::Vector2d d_time = d_rig * (pose.origin_m_s + position_m * pose.direction_s);
  slopes->reduced.clear();
  const KernelColumns& columns = ColumnsOf(layout, observation);
  if (columns.pose >= 0) {
    for (int i = 0; i < 3; ++i) {
      slopes->reduced.emplace_back(columns.pose + i,
                                   d_point * Eigen::Vector3d::Unit(i).cross(rotated));
      slopes->reduced.emplace_back(columns.pose + 3 + i, d_point.col(i));
    }
  }
  for (int b = 0; b < columns.base_count; ++b) {
    const int kind = columns.base_kind[b];
    Eigen::Vector2d derivative;
    if (kind == ViewUnknowns::kOffset) {
      derivative = d_time;
    } else if (kind == ViewUnknowns::kRate) {
      derivative = observation.clock_time_s * d_time;
    } else if (kind == ViewUnknowns::kLineDelay) {
      derivative = (marker.centre_px.y() - camera.middle_row) * d_time;
    } else {
      derivative = root * d_intrinsics.col(kind - ViewUnknowns::kFirstIntrinsic);
    }
    slopes->reduced.emplace_back(columns.base_column[b], derivative);
  }
  if (layout.spacing_column >= 0 && marker.marker > 0) {
    slopes->reduced.emplace_back(layout.spacing_column + marker.marker - 1, d_rig * pose.direction);
  }
  return true;
}

void ForEachUnknownOf(const LineBundleLayout& layout, const BundleObservation& observation,
                      const BundleMarker& marker, BundleProblem* rows,
                      absl::FunctionRef<void(int column, double step)> function) {
  BundleCamera& camera = rows->cameras[static_cast<size_t>(observation.camera)];
  BundleClock& clock = rows->clocks[static_cast<size_t>(observation.clock)];
  const KernelColumns& columns = ColumnsOf(layout, observation);
  const auto move = [&function](int column, double step, double* value) {
    const double before = *value;
    *value += step;
    function(column, step);
    *value = before;
  };
  if (columns.pose >= 0) {
    for (int i = 0; i < 3; ++i) {
      const Eigen::Quaterniond before = camera.cam_from_rig.rotation;
      camera.cam_from_rig.rotation =
          Eigen::Quaterniond(Eigen::AngleAxisd(kKnotStep, Eigen::Vector3d::Unit(i))) * before;
      function(columns.pose + i, kKnotStep);
      camera.cam_from_rig.rotation = before;
      move(columns.pose + 3 + i, kKnotStep, &camera.cam_from_rig.translation_m[i]);
    }
  }
  for (int b = 0; b < columns.base_count; ++b) {
    const int kind = columns.base_kind[b], column = columns.base_column[b];
    if (kind == ViewUnknowns::kOffset) {
      move(column, kTimeStepS, &clock.time_offset_s);
    } else if (kind == ViewUnknowns::kRate) {
      move(column, kTimeStepS / std::max(1.0, std::abs(observation.clock_time_s)),
           &clock.time_rate);
    } else if (kind == ViewUnknowns::kLineDelay) {
      move(column, kTimeStepS / camera.middle_row, &camera.line_delay_s);
    } else {
      double* const value = &camera.intrinsics[kind - ViewUnknowns::kFirstIntrinsic];
      move(column, kKnotStep * std::max(1.0, std::abs(*value)), value);
    }
  }
  if (layout.spacing_column >= 0 && marker.marker > 0) {
    move(layout.spacing_column + marker.marker - 1, kKnotStep,
         &rows->target.marker_positions_m[static_cast<size_t>(marker.marker)]);
  }
}

}  // namespace rigcal::server
