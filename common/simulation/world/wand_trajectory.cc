// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/wand_trajectory.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/simulation/world/random_stream.h"

namespace rigcal {
namespace {

constexpr uint64_t kWandPurpose = 0x77616e64;  // sets these random numbers apart from others
constexpr double kAzimuthRate = 0.9;           // radians per unit of phase
constexpr double kShares[3] = {0.6, 0.25, 0.15};
// Ratios that repeat late, so that the path goes on into new parts of the volume.
constexpr double kFrequencies[3] = {1, 1.6180339887, 2.7182818285};

}  // namespace

double WandTrajectory::Swing::At(double phase) const {
  double sum = 0;
  for (const Sine& sine : sines) {
    sum += sine.amplitude * std::sin(sine.frequency * phase + sine.phase);
  }
  return sum;
}

double WandTrajectory::Swing::Slope(double phase) const {
  double sum = 0;
  for (const Sine& sine : sines) {
    sum += sine.amplitude * sine.frequency * std::cos(sine.frequency * phase + sine.phase);
  }
  return sum;
}

WandTrajectory::WandTrajectory(uint32_t seed, const WaveVolume& volume, double duration_s,
                               double max_speed_m_s)
    : centre_m_(volume.centre_m) {
  RandomStream random{seed, kWandPurpose};
  const auto make_swing = [&](double amplitude, double frequency) {
    Swing swing;
    for (size_t i = 0; i < swing.sines.size(); ++i) {
      swing.sines[i] = {amplitude * kShares[i],
                        frequency * kFrequencies[i] * random.Uniform(0.93, 1.07),
                        random.Uniform(0, 2 * std::numbers::pi)};
    }
    return swing;
  };
  for (int axis = 0; axis < 3; ++axis) {
    axes_[static_cast<size_t>(axis)] =
        make_swing(volume.half_extent_m[axis], 1 + 0.17 * static_cast<double>(axis));
  }
  azimuth_ = make_swing(0.8, 0.71);
  elevation_ = make_swing(1.5, 1.3);
  roll_ = make_swing(2.0, 0.9);

  // Between two steps of the walk the speed may be a little higher than at both.
  constexpr double kMargin = 1.001;
  phase_per_second_ = max_speed_m_s / (kMargin * PeakSlope(max_speed_m_s * duration_s));
}

// The longer the stretch of phase that fits into the duration, the higher the peak met on it: walks
// along until the peak so far, at the pace that ends here, covers the distance. A wave so long that
// the walk would take long meets nearly the highest speed there is.
double WandTrajectory::PeakSlope(double distance_m) const {
  constexpr double kStep = 0.02;
  constexpr int kMaxSteps = 100000;
  double peak = 0;
  for (int step = 0; step < kMaxSteps; ++step) {
    const double phase = kStep * step;
    const Eigen::Vector3d slope(axes_[0].Slope(phase), axes_[1].Slope(phase),
                                axes_[2].Slope(phase));
    peak = std::max(peak, slope.norm());
    if (phase * peak >= distance_m) return peak;
  }
  Eigen::Vector3d highest = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    for (const Sine& sine : axes_[static_cast<size_t>(axis)].sines) {
      highest[axis] += sine.amplitude * sine.frequency;
    }
  }
  return highest.norm();
}

Eigen::Vector3d WandTrajectory::Middle(double rig_time_s) const {
  const double phase = phase_per_second_ * rig_time_s;
  return centre_m_ + Eigen::Vector3d(axes_[0].At(phase), axes_[1].At(phase), axes_[2].At(phase));
}

Eigen::Vector3d WandTrajectory::Direction(double rig_time_s) const {
  const double phase = phase_per_second_ * rig_time_s;
  const double azimuth = kAzimuthRate * phase + azimuth_.At(phase);
  const double elevation = elevation_.At(phase);
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
          std::sin(elevation)};
}

Eigen::Quaterniond WandTrajectory::Rotation(double rig_time_s) const {
  const double phase = phase_per_second_ * rig_time_s;
  const double azimuth = kAzimuthRate * phase + azimuth_.At(phase);
  return Eigen::AngleAxisd(azimuth, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(-elevation_.At(phase), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll_.At(phase), Eigen::Vector3d::UnitX());
}

}  // namespace rigcal
