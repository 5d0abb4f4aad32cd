// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/bundle_scene.h"

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <string>

#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"

namespace rigcal::testing {
namespace {

using server::BundleCamera;
using server::BundleClock;
using server::BundleInstant;
using server::BundleMarker;
using server::BundleObservation;
using server::BundleProblem;

constexpr double kWidth = 1280, kHeight = 1024;
constexpr double kMaxSpeed_m_s = 1.5;

class Builder {
 public:
  explicit Builder(const BundleSceneOptions& options) : options_(options), random_(options.seed) {}

  BundleScene Build() {
    AddClocks();
    for (int c = 0; c < options_.camera_count; ++c) AddCamera(c);
    ground_truth_.target.marker_positions_m = options_.marker_positions_m;
    ground_truth_.target.given_positions_m = options_.marker_positions_m;
    ground_truth_.target.fixed = !options_.free_spacing;
    ground_truth_.rigid_target.points_m = options_.points_m;
    ground_truth_.rigid_target.given_points_m = options_.points_m;
    ground_truth_.rigid_target.sigma_m.assign(options_.points_m.size(), 0.001);
    ground_truth_.rigid_target.fixed = !options_.free_points;
    for (int i = 0; i < options_.instant_count; ++i) AddInstant(i);
    return {Perturbed(), ground_truth_};
  }

 private:
  double Normal(double sigma) { return std::normal_distribution<double>(0, 1)(random_) * sigma; }
  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  Eigen::Vector3d Normal3(double sigma) {
    const double x = Normal(sigma), y = Normal(sigma);
    return {x, y, Normal(sigma)};
  }
  int ClockCount() const {
    return options_.clock_count > 0 ? options_.clock_count : options_.camera_count;
  }

  void AddClocks() {
    for (int k = 0; k < ClockCount(); ++k) {
      BundleClock clock;
      clock.clock_id = "clock_" + std::to_string(k);
      if (k > 0) {
        clock.time_offset_s = Normal(options_.offset_s);
        clock.time_rate = options_.free_rates ? Normal(options_.rate) : 0;
        clock.offset_fixed = !options_.free_offsets;
        clock.rate_fixed = !options_.free_rates;
        clock.rate_sigma = 1e-4;
      }
      ground_truth_.clocks.push_back(clock);
    }
  }

  void AddCamera(int index) {
    BundleCamera camera;
    camera.name = "camera_" + std::to_string(index);
    const double angle = 2 * M_PI * index / options_.camera_count + Uniform(-0.1, 0.1);
    const Eigen::Vector3d centre(4 * std::cos(angle), 4 * std::sin(angle), Uniform(0.5, 2.5));
    const Eigen::Vector3d forward = (Eigen::Vector3d(0, 0, 1) - centre).normalized();
    const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
    Eigen::Matrix3d rotation;  // cam_from_rig
    rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    camera.cam_from_rig = {Eigen::Quaterniond(rotation), rotation * -centre};
    camera.pose_fixed = index == 0 || !options_.free_poses;
    camera.model = options_.models[static_cast<size_t>(index) % options_.models.size()];
    const int size = IntrinsicsSize(camera.model);
    camera.intrinsics.setZero(size);
    camera.intrinsics.head<4>() << 1000 + Normal(20), 1000 + Normal(20), 640 + Normal(10),
        512 + Normal(10);
    for (int i = 4; i < size; ++i) camera.intrinsics[i] = Normal(i < 6 ? 0.03 : 0.002);
    camera.intrinsics_fixed = !options_.free_intrinsics;
    camera.intrinsics_mean = camera.intrinsics;
    camera.intrinsics_sigma.setConstant(size, 0.02);
    camera.intrinsics_sigma.head<4>().setConstant(10);
    if (index % 2 == 1) camera.intrinsics_sigma[size - 1] = 0;  // held
    camera.middle_row = 0.5 * (kHeight - 1);
    if (options_.free_line_delays) {
      camera.line_delay_s = Normal(2e-5);
      camera.line_delay_fixed = false;
      camera.line_delay_sigma_s = 1e-4;
    }
    ground_truth_.cameras.push_back(camera);
  }

  void AddInstant(int index) {
    BundleInstant instant;
    instant.origin_m = {Uniform(-1, 1), Uniform(-1, 1), Uniform(0.3, 1.7)};
    instant.direction = Normal3(1).normalized();
    instant.is_rigid = options_.rigid_every > 0 && index % options_.rigid_every == 0;
    if (instant.is_rigid) {
      instant.rotation =
          Eigen::Quaterniond(Normal(1), Normal(1), Normal(1), Normal(1)).normalized();
    }
    instant.first_observation = static_cast<int>(ground_truth_.observations.size());
    const Eigen::Vector3d velocity = Normal3(kMaxSpeed_m_s / 2);
    for (int c = 0; c < options_.camera_count; ++c) {
      if (Uniform(0, 1) < options_.hidden_share) continue;
      AddObservation(c, 0.1 * index, instant, velocity);
    }
    instant.observation_count =
        static_cast<int>(ground_truth_.observations.size()) - instant.first_observation;
    ground_truth_.instants.push_back(instant);
  }

  void AddObservation(int camera, double time_s, const BundleInstant& instant,
                      const Eigen::Vector3d& velocity) {
    BundleObservation observation;
    observation.camera = camera;
    observation.clock = camera % ClockCount();
    observation.clock_time_s = time_s;
    observation.first_marker = static_cast<int>(ground_truth_.markers.size());
    const size_t count =
        instant.is_rigid ? options_.points_m.size() : options_.marker_positions_m.size();
    for (size_t m = 0; m < count; ++m) {
      if (Uniform(0, 1) < options_.dropout_share) continue;
      BundleMarker marker;
      marker.marker = static_cast<int>(m);
      const Eigen::Vector3d x_in_rig = ground_truth_.PointOf(instant, marker);
      ground_truth_.markers.push_back(
          Measure(observation, static_cast<int>(m), x_in_rig, velocity));
    }
    observation.marker_count =
        static_cast<int>(ground_truth_.markers.size()) - observation.first_marker;
    ground_truth_.observations.push_back(observation);
  }

  BundleMarker Measure(const BundleObservation& observation, int index,
                       const Eigen::Vector3d& x_in_rig, const Eigen::Vector3d& velocity) {
    const BundleCamera& camera = ground_truth_.cameras[static_cast<size_t>(observation.camera)];
    const BundleClock& clock = ground_truth_.clocks[static_cast<size_t>(observation.clock)];
    BundleMarker marker;
    marker.marker = index;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> jacobian;
    marker.used = Project(camera.model, camera.intrinsics.data(), camera.cam_from_rig * x_in_rig,
                          &pixel, &jacobian, nullptr);
    if (!marker.used) return marker;
    marker.velocity_px_s = jacobian * (camera.cam_from_rig.rotation * velocity);
    // At the row where it is then measured.
    const double middle_s = clock.time_offset_s + clock.time_rate * observation.clock_time_s;
    const double rows = (pixel.y() + middle_s * marker.velocity_px_s.y() - camera.middle_row) /
                        (1 - camera.line_delay_s * marker.velocity_px_s.y());
    const double offset_s = middle_s + camera.line_delay_s * rows;
    const Eigen::Vector2d noise(Normal(options_.noise_px), Normal(options_.noise_px));
    marker.centre_px = pixel + offset_s * marker.velocity_px_s + noise;
    if (Uniform(0, 1) < options_.outlier_share) {
      marker.centre_px = {Uniform(0, kWidth), Uniform(0, kHeight)};
    }
    // Elongated and rotated: errors of shape or orientation show.
    const double angle = Uniform(0, M_PI), sigma = std::max(options_.noise_px, 0.1);
    marker.sqrt_information = Eigen::DiagonalMatrix<double, 2>(1 / sigma, 0.8 / sigma) *
                              Eigen::Rotation2Dd(angle).toRotationMatrix();
    return marker;
  }

  BundleProblem Perturbed() {
    BundleProblem initial = ground_truth_;
    const double scale = options_.initial_error;
    for (BundleCamera& camera : initial.cameras) {
      const Eigen::Vector3d rotation = Normal3(0.01 * scale), shift = Normal3(0.02 * scale);
      if (!camera.pose_fixed) {
        const Eigen::Quaterniond by(
            Eigen::AngleAxisd(rotation.norm(), rotation.stableNormalized()));
        camera.cam_from_rig.rotation = by * camera.cam_from_rig.rotation;
        camera.cam_from_rig.translation_m += shift;
      }
      if (camera.intrinsics_fixed) continue;
      for (int i = 0; i < camera.intrinsics.size(); ++i) {
        camera.intrinsics[i] += Normal(0.3 * camera.intrinsics_sigma[i]);
      }
      camera.intrinsics_mean = camera.intrinsics;
    }
    for (BundleCamera& camera : initial.cameras) {
      if (!camera.line_delay_fixed) camera.line_delay_s = 0;
    }
    for (BundleClock& clock : initial.clocks) {
      if (!clock.offset_fixed) clock.time_offset_s = 0;
      if (!clock.rate_fixed) clock.time_rate = 0;
    }
    if (!initial.target.fixed) {
      for (size_t m = 1; m < initial.target.marker_positions_m.size(); ++m) {
        initial.target.marker_positions_m[m] += Normal(0.001);
      }
      initial.target.given_positions_m = initial.target.marker_positions_m;
    }
    if (!initial.rigid_target.fixed) {
      for (Eigen::Vector3d& point : initial.rigid_target.points_m) point += Normal3(0.001);
      initial.rigid_target.given_points_m = initial.rigid_target.points_m;
    }
    for (BundleInstant& instant : initial.instants) {
      instant.origin_m += Normal3(0.03 * scale);
      instant.direction = (instant.direction + Normal3(0.05 * scale)).normalized();
      if (!instant.is_rigid) continue;
      const Eigen::Vector3d turn = Normal3(0.05 * scale);
      instant.rotation = Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()) *
                         Eigen::Quaterniond(instant.rotation);
    }
    return initial;
  }

  BundleSceneOptions options_;
  std::mt19937 random_;
  BundleProblem ground_truth_;
};

}  // namespace

BundleScene MakeBundleScene(const BundleSceneOptions& options) { return Builder(options).Build(); }

BundleSceneOptions SmallBundleScene() {
  BundleSceneOptions options;
  options.camera_count = 4;
  options.instant_count = 27;
  options.models = {DistortionModel::kBrownConrady, DistortionModel::kFisheye,
                    DistortionModel::kRational};
  options.dropout_share = 0.1;
  return options;
}

server::BundleOptions TightTolerances() {
  server::BundleOptions options;
  options.max_iterations = 300;
  options.function_tolerance = 1e-14;
  options.gradient_tolerance = 1e-12;
  options.parameter_tolerance = 1e-14;
  return options;
}

}  // namespace rigcal::testing
