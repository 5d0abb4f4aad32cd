// SPDX-License-Identifier: Apache-2.0
#include "tests/server/solve/trajectory/trajectory_scene.h"

#include <cmath>
#include <random>
#include <string>
#include <utility>

#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"

namespace rigcal::server {
namespace {

// A random walk of the jerk, tamed: steady motion through some decimetres and half turns.
TrajectorySpan RandomPath(const TrajectorySceneOptions& options, std::mt19937* random) {
  std::normal_distribution<double> normal;
  TrajectorySpan span;
  span.begin_s = -0.2;
  span.step_s = options.step_s;
  span.size = options.is_point ? TrajectorySpan::kPointSize : TrajectorySpan::kLineSize;
  const auto count =
      static_cast<Eigen::Index>(std::ceil((options.duration_s + 0.4) / span.step_s)) + 3;
  span.knots.resize(count * span.size);
  Eigen::VectorXd phase(3 * span.size);
  for (double& value : phase) value = 3 * normal(*random);
  for (Eigen::Index k = 0; k < count; ++k) {
    const double t = static_cast<double>(k) * span.step_s;
    for (Eigen::Index c = 0; c < span.size; ++c) {
      double value = 0;
      for (Eigen::Index i = 0; i < 3; ++i) {
        const double hz = 0.3 + 0.35 * static_cast<double>(i) + 0.02 * static_cast<double>(c);
        value += std::sin(2 * M_PI * hz * t + phase[3 * c + i]);
      }
      span.knots[k * span.size + c] = c < 3 ? 0.15 * value : 0.3 * value + (c == 3 ? 1.5 : 0);
    }
    if (span.has_direction()) span.knots.segment<3>(k * span.size + 3).normalize();
  }
  return span;
}

BundleCamera CameraOfRing(int index, int count, double focal_px) {
  BundleCamera camera;
  camera.name = "camera_" + std::to_string(index);
  const double angle = 2 * M_PI * index / count;
  const Eigen::Vector3d centre(2 * std::cos(angle), 2 * std::sin(angle), 0.4 + 0.1 * index);
  const Eigen::Vector3d forward = -centre.normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d rotation;
  rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  camera.cam_from_rig.rotation = Eigen::Quaterniond(rotation);
  camera.cam_from_rig.translation_m = -(rotation * centre);
  camera.pose_fixed = index == 0;
  camera.intrinsics = IntrinsicsVector::Zero(IntrinsicsSize(camera.model));
  camera.intrinsics.head<4>() << focal_px, focal_px, 640, 512;
  camera.middle_row = 512;
  camera.line_delay_fixed = false;
  return camera;
}

// The path in the frame of a camera.
void Move(const RigidTransform& cam_from_rig, TrajectorySpan* span) {
  for (Eigen::Index k = 0; k < span->knot_count(); ++k) {
    auto origin = span->knots.segment<3>(k * span->size);
    origin = (cam_from_rig * Eigen::Vector3d(origin)).eval();
    if (!span->has_direction()) continue;
    auto direction = span->knots.segment<3>(k * span->size + 3);
    direction = (cam_from_rig.rotation * Eigen::Vector3d(direction)).eval();
  }
}

// Where a marker is seen, whose image row decides when: by iteration.
Eigen::Vector2d SeenAt(const TrajectorySpan& span, const BundleCamera& camera, double position_m,
                       double row_time_s) {
  Eigen::Vector2d pixel(0, camera.middle_row);
  for (int i = 0; i < 30; ++i) {
    const double t = row_time_s + camera.line_delay_s * (pixel.y() - camera.middle_row);
    const TrajectoryPose pose = PoseAt(span, WeightsAt(span, t));
    Project(camera.model, camera.intrinsics.data(),
            camera.cam_from_rig * (pose.origin_m + position_m * pose.direction), &pixel, nullptr,
            nullptr);
  }
  return pixel;
}

}  // namespace

TrajectoryScene MakeTrajectoryScene(const TrajectorySceneOptions& options) {
  std::mt19937 random(options.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  TrajectoryScene scene;
  TrajectoryProblem& truth = scene.ground_truth;
  truth.spans.push_back(RandomPath(options, &random));
  const RigidTransform first_from_room =
      CameraOfRing(0, options.camera_count, options.focal_px).cam_from_rig;
  Move(first_from_room, &truth.spans[0]);
  truth.rows.target.fixed = !options.free_spacing;
  std::vector<double> positions_m =
      options.is_point ? std::vector<double>{0} : options.marker_positions_m;
  truth.rows.target.span_sigma_m = options.span_sigma_m;
  truth.rows.target.given_positions_m = positions_m;
  for (size_t m = 1; options.draw_spans && m < positions_m.size(); ++m) {
    const double longer_m = options.span_sigma_m * normal(random);
    for (size_t n = m; n < positions_m.size(); ++n) positions_m[n] += longer_m;
  }
  truth.rows.target.marker_positions_m = positions_m;
  for (int c = 0; c < options.camera_count; ++c) {
    BundleCamera camera = CameraOfRing(c, options.camera_count, options.focal_px);
    camera.cam_from_rig = camera.cam_from_rig * first_from_room.Inverse();
    if (c == 0) camera.cam_from_rig = RigidTransform();
    camera.line_delay_s = options.line_delay_s * (c % 2 == 0 ? 1 : -0.5);
    BundleClock clock;
    clock.clock_id = camera.name;
    clock.offset_fixed = c == 0;
    clock.time_offset_s = c == 0 ? 0 : 0.003 * normal(random);
    truth.rows.cameras.push_back(camera);
    truth.rows.clocks.push_back(clock);
    const double phase_s = uniform(random) / options.rate_hz;
    for (double t = phase_s; t < options.duration_s; t += 1 / options.rate_hz) {
      if (uniform(random) >= options.kept_share) continue;
      BundleInstant row;
      row.first_observation = static_cast<int>(truth.rows.observations.size());
      row.observation_count = 1;
      const int first_marker = static_cast<int>(truth.rows.markers.size());
      for (size_t m = 0; m < truth.rows.target.marker_positions_m.size(); ++m) {
        BundleMarker marker;
        marker.marker = static_cast<int>(m);
        marker.centre_px = SeenAt(truth.spans[0], camera, truth.rows.target.marker_positions_m[m],
                                  t + clock.time_offset_s);
        marker.centre_px += options.noise_px * Eigen::Vector2d(normal(random), normal(random));
        marker.sqrt_information = Eigen::Matrix2d::Identity() / options.stated_px;
        truth.rows.markers.push_back(marker);
        truth.time_s.push_back(t);
      }
      truth.rows.observations.push_back(
          {c, c, t, first_marker, static_cast<int>(truth.rows.markers.size()) - first_marker});
      truth.rows.instants.push_back(row);
      truth.span_of_row.push_back(0);
    }
  }
  if (options.is_point) {
    const auto centre = [&truth](size_t c) {
      return truth.rows.cameras[c].cam_from_rig.SourceFromTargetTranslation();
    };
    truth.rows.distance = BundleDistance{0, 1, (centre(0) - centre(1)).norm(), 1e-4};
  }
  scene.initial = truth;
  scene.initial.rows.target.marker_positions_m = truth.rows.target.given_positions_m;
  const double error = options.initial_error;
  for (size_t c = 0; c < truth.rows.cameras.size(); ++c) {
    BundleCamera& camera = scene.initial.rows.cameras[c];
    camera.line_delay_s = 0;
    if (c == 0) continue;
    const Eigen::Vector3d axis =
        Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    camera.cam_from_rig.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(0.005 * error, axis)) * camera.cam_from_rig.rotation;
    camera.cam_from_rig.translation_m += 0.005 * error * axis;
    scene.initial.rows.clocks[c].time_offset_s += 1e-3 * error * normal(random);
  }
  TrajectorySpan& span = scene.initial.spans[0];
  for (double& value : span.knots) value += 0.02 * error * normal(random);
  for (BundleCamera& camera : scene.initial.rows.cameras) {
    camera.cam_from_rig.translation_m *= options.initial_scale;
  }
  for (double& position_m : scene.initial.rows.target.marker_positions_m) {
    position_m *= options.initial_scale;
  }
  for (Eigen::Index k = 0; k < span.knot_count(); ++k) {
    span.knots.segment<3>(k * span.size) *= options.initial_scale;
  }
  return scene;
}

}  // namespace rigcal::server
