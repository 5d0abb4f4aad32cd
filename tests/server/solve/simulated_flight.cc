// SPDX-License-Identifier: Apache-2.0
#include "tests/server/solve/simulated_flight.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_world.h"
#include "tests/server/solve/simulated_targets.h"

namespace rigcal::server {
namespace {

constexpr uint64_t kFlightCameraPurpose = 0x666c79;
constexpr uint64_t kFlightPathPurpose = 0x70617468;
constexpr uint64_t kFlightNoisePurpose = 0x6e6f6973;
const ImageSize kFlightImage{1920, 1080};
constexpr double kFlightFocalPx = 1400;
constexpr double kMostOfPeriod = 0.95;
constexpr double kPathHz = 50;
constexpr int kWavesPerAxis = 12;
constexpr int64_t kFlightOriginNs = 100'000'000'000;

// A sum of sines: smooth, and never the same twice.
class FlightPath {
 public:
  explicit FlightPath(uint32_t seed) {
    RandomStream random{seed, kFlightPathPurpose};
    for (auto& axis : waves_) {
      for (Wave& wave : axis) {
        const double period_s = random.LogUniform(1.5, 60);
        wave.omega = 2 * std::numbers::pi / period_s;
        wave.phase = random.Uniform(0, 2 * std::numbers::pi);
        // At most 7 m, and 0.8 m/s^2.
        wave.amplitude_m = std::min(7.0, 0.8 / (wave.omega * wave.omega)) * random.Uniform(0.5, 1);
      }
    }
  }

  Eigen::Vector3d At(double time_s) const {
    Eigen::Vector3d position_m(0, 0, 20);
    for (int axis = 0; axis < 3; ++axis) {
      double sum_m = 0;
      for (const Wave& wave : waves_[axis]) {
        sum_m += wave.amplitude_m * std::sin(wave.omega * time_s + wave.phase);
      }
      position_m[axis] += (axis == 2 ? 0.4 : 1) * sum_m;
    }
    return position_m;
  }

 private:
  struct Wave {
    double omega, phase, amplitude_m;
  };
  Wave waves_[3][kWavesPerAxis];
};

RigidTransform LookAtFlight(const Eigen::Vector3d& position, RandomStream* random) {
  const Eigen::Vector3d target(random->Uniform(-4, 4), random->Uniform(-4, 4), 18);
  const Eigen::Vector3d z = (target - position).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d cam_from_rig;
  cam_from_rig << x.transpose(), z.cross(x).transpose(), z.transpose();
  const Eigen::Quaterniond rotation(cam_from_rig);
  return {rotation, rotation * -position};
}

double MiddleOf(uint32_t size_px) { return 0.5 * (size_px - 1.0); }

}  // namespace

SimulatedFlight FlyPoint(const SimulatedFlightOptions& options) {
  SimulatedFlight flight;
  flight.input.target = PointTarget();
  flight.path_hz = kPathHz;
  const FlightPath path(options.seed);
  for (int i = 0; i < static_cast<int>(options.duration_s * kPathHz); ++i) {
    flight.path_m.push_back(path.At(i / kPathHz));
  }
  for (int c = 0; c < options.camera_count; ++c) {
    RandomStream random{options.seed, kFlightCameraPurpose, static_cast<uint64_t>(c)};
    SimulatedFlightCamera camera;
    camera.rate_hz = random.Uniform(options.slowest_hz, options.fastest_hz);
    camera.line_delay_s = std::min(random.Uniform(options.shortest_s, options.longest_s),
                                   kMostOfPeriod / camera.rate_hz / kFlightImage.height);
    camera.time_offset_s = random.Uniform(-options.largest_offset_s, options.largest_offset_s);
    const double rate = 1e-6 * random.Uniform(-options.largest_rate_ppm, options.largest_rate_ppm);
    const double phase_s = random.Uniform() / camera.rate_hz;
    const double angle =
        2 * std::numbers::pi * (c + random.Uniform(-0.3, 0.3)) / options.camera_count;
    const double far_m = random.Uniform(40, 60);
    camera.cam_from_rig = LookAtFlight(
        {far_m * std::cos(angle), far_m * std::sin(angle), random.Uniform(1, 3)}, &random);
    Intrinsics lens;
    lens.fx_px = kFlightFocalPx * random.Uniform(0.95, 1.05);
    lens.fy_px = lens.fx_px * random.Uniform(0.999, 1.001);
    lens.cx_px = 959.5 + random.Uniform(-15, 15);
    lens.cy_px = 539.5 + random.Uniform(-15, 15);
    lens.distortion = {random.Uniform(-0.05, 0.05), random.Uniform(-0.05, 0.05), 0, 0, 0};
    Intrinsics given = lens;
    const double focal = 1 + options.focal_sigma_rel * random.Gaussian();
    given.fx_px *= focal;
    given.fy_px *= focal;
    given.cx_px += options.centre_sigma_px * random.Gaussian();
    given.cy_px += options.centre_sigma_px * random.Gaussian();

    CameraTrack track;
    track.session_id = "flight";
    track.camera.camera = absl::StrCat("cam", c);
    track.camera.image_size_px = kFlightImage;
    track.camera.intrinsics = given;
    track.camera.clock = {absl::StrCat("clock", c), "flight"};
    const int frames = static_cast<int>((options.duration_s - phase_s) * camera.rate_hz);
    for (int i = 0; i < frames; ++i) {
      RandomStream noise{options.seed, kFlightNoisePurpose, static_cast<uint64_t>(c),
                         static_cast<uint64_t>(i)};
      const double time_s = phase_s + i / camera.rate_hz;
      // The row in which the point is says when it was seen; the point moves little meanwhile.
      Eigen::Vector2d pixel(0, MiddleOf(kFlightImage.height));
      bool seen = true;
      for (int round = 0; round < 4 && seen; ++round) {
        const double late_s = camera.line_delay_s * (pixel.y() - MiddleOf(kFlightImage.height));
        seen = ImageOf(lens, camera.cam_from_rig * path.At(time_s + late_s), &pixel);
      }
      pixel.x() += options.noise_px * noise.Gaussian();
      pixel.y() += options.noise_px * noise.Gaussian();
      Observation row;
      const double camera_s = (time_s - camera.time_offset_s) / (1 + rate);
      row.time_ns = kFlightOriginNs + std::llround(1e9 * camera_s);
      if (seen && pixel.x() > 0 && pixel.x() < kFlightImage.width - 1.0 && pixel.y() > 0 &&
          pixel.y() < kFlightImage.height - 1.0) {
        MarkerObservation marker;
        marker.visible = true;
        marker.centre_px = pixel;
        marker.covariance_px2 = options.noise_px * options.noise_px * Eigen::Matrix2d::Identity();
        row.markers.push_back(marker);
      }
      track.observations.push_back(row);
    }
    flight.input.tracks.push_back(std::move(track));
    flight.cameras.push_back(camera);
  }
  return flight;
}

}  // namespace rigcal::server
