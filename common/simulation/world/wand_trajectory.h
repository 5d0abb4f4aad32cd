// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>

namespace rigcal {

// The volume in which the wand's middle moves: a box in frame `rig`.
struct WaveVolume {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_extent_m = Eigen::Vector3d::Ones();
};

// The motion of a simulated wand: its middle by a sum of three sines along each axis, its direction
// by an azimuth that turns on and an elevation that swings up and down, its roll by another swing.
// Every derivative is continuous.
class WandTrajectory {
 public:
  WandTrajectory() = default;
  // Time runs so that over [0, duration_s] the middle's speed peaks at max_speed_m_s.
  WandTrajectory(uint32_t seed, const WaveVolume& volume, double duration_s, double max_speed_m_s);

  Eigen::Vector3d Middle(double rig_time_s) const;     // x_in_rig, metres
  Eigen::Vector3d Direction(double rig_time_s) const;  // unit, in rig
  // rig_from_target of a rigid target: its x axis is the direction, about which it rolls.
  Eigen::Quaterniond Rotation(double rig_time_s) const;

 private:
  struct Sine {
    double amplitude = 0;
    double frequency = 1;  // radians per unit of phase
    double phase = 0;
  };
  struct Swing {
    std::array<Sine, 3> sines;
    double At(double phase) const;
    double Slope(double phase) const;
  };

  double PeakSlope(double distance_m) const;

  Eigen::Vector3d centre_m_ = Eigen::Vector3d::Zero();
  std::array<Swing, 3> axes_;
  Swing azimuth_;
  Swing elevation_;
  Swing roll_;
  double phase_per_second_ = 1;
};

}  // namespace rigcal
