// SPDX-License-Identifier: Apache-2.0
#include "tests/server/solve/clocks/synthetic_paths.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace rigcal::server {
namespace {

constexpr double kFocalPx = 1000;
constexpr double kDistanceM = 4;
constexpr double kSpacingM = 0.2;

// Coordinates of the wand's middle (m) and direction (rad) as sums of sines.
class SyntheticMotion {
 public:
  SyntheticMotion(uint32_t seed, double period_s) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> phase(0, 2 * std::numbers::pi), slow(0.1, 0.6);
    for (auto& swing : swings_) {
      for (int i = 0; i < 3; ++i) {
        const double hz = period_s > 0 ? (1 + i) / period_s : slow(random);
        swing.push_back({2 * std::numbers::pi * hz, phase(random), 0.5 / (1 + i)});
      }
    }
  }
  Eigen::Vector3d At(double time_s, double along_m) const {
    double values[5] = {};
    for (size_t k = 0; k < 5; ++k) {
      for (const Sine& sine : swings_[k]) {
        values[k] += sine.amplitude * std::sin(sine.frequency * time_s + sine.phase);
      }
    }
    const Eigen::Vector3d direction(std::cos(values[3]) * std::cos(values[4]),
                                    std::cos(values[3]) * std::sin(values[4]), std::sin(values[3]));
    return Eigen::Vector3d(values[0], values[1], values[2]) + along_m * direction;
  }

 private:
  struct Sine {
    double frequency, phase, amplitude;
  };
  std::vector<Sine> swings_[5];
};

}  // namespace

TrackPaths SyntheticPaths(const SyntheticView& view) {
  const SyntheticMotion motion(view.seed, view.period_s);
  std::mt19937 random(1000 * view.seed + static_cast<uint32_t>(view.view));
  std::normal_distribution<double> noise(0, view.noise_px / kFocalPx);
  const Eigen::Matrix3d turn = (Eigen::AngleAxisd(0.15 * view.view, Eigen::Vector3d::UnitX()) *
                                Eigen::AngleAxisd(0.9 * view.view, Eigen::Vector3d::UnitY()))
                                   .toRotationMatrix();
  TrackPaths paths;
  paths.focal_px = kFocalPx;
  paths.period_s = 1 / view.rate_hz;
  paths.gap_s = 3.5 * paths.period_s;
  paths.markers.resize(view.markers);
  for (int i = 0; i < static_cast<int>(view.duration_s * view.rate_hz); ++i) {
    // Cameras do not expose together.
    const double motion_s = view.start_s + (i + 0.37 * view.view) / view.rate_hz;
    for (size_t m = 0; m < view.markers; ++m) {
      const Eigen::Vector3d x_in_cam =
          turn * (view.size * motion.At(motion_s, kSpacingM * static_cast<double>(m))) +
          Eigen::Vector3d(0, 0, kDistanceM);
      paths.markers[m].time_s.push_back(motion_s - view.offset_s);
      paths.markers[m].ray.push_back(x_in_cam.hnormalized() +
                                     Eigen::Vector2d(noise(random), noise(random)));
    }
  }
  return paths;
}

}  // namespace rigcal::server
