// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"

namespace rigcal {

// How a part of the calibration is treated.
enum class Estimate : uint8_t {
  kDefault = 0,
  kFixed = 1,    // keep as given
  kRefined = 2,  // estimate
  kAuto = 3,     // estimate where held-out data says that it pays
};

// How the target's motion between rows is treated.
enum class TrajectoryChoice : uint8_t {
  kAuto = 0,          // a spline where interpolation leaves much out, and held-out data agree
  kInterpolated = 1,  // rows are moved to common instants along their image motion
  kSpline = 2,        // one path through time, of which every row is a part
};

// The measured distance between the optical centres of two cameras.
struct KnownDistance {
  static constexpr double kDefaultSigmaM = 0.002;

  std::string camera_a, camera_b;
  double distance_m = 0;  // > 0
  double sigma_m = 0;     // one sigma; 0 = kDefaultSigmaM

  double SigmaM() const { return sigma_m > 0 ? sigma_m : kDefaultSigmaM; }
  friend bool operator==(const KnownDistance&, const KnownDistance&) = default;
};

// What to solve.
struct CalibrationOptions {
  std::string reference_camera;  // its pose is the rig frame; empty: the lowest name
  Estimate intrinsics = Estimate::kDefault;
  Estimate time_offsets = Estimate::kDefault;
  Estimate marker_positions = Estimate::kDefault;
  TrajectoryChoice trajectory = TrajectoryChoice::kAuto;
  double sigma_px = 0;                 // one sigma of every centre, pixels; 0 = as observed
  double association_tolerance_s = 0;  // of two observations of one instant; 0 = from the periods
  uint32_t seed = 0;                   // of every random choice
  std::optional<KnownDistance> known_distance;  // the scale, for a target of one marker
  // Largest acceptable error, metres: with a larger predicted error the result is bad. 0: 1 % of
  // the median distance of the cameras from the middle of the waved volume.
  double accept_m = 0;

  friend bool operator==(const CalibrationOptions&, const CalibrationOptions&) = default;
  absl::Status Validate() const;
};

}  // namespace rigcal
