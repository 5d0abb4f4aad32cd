// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "agent/event/evt3_writer.h"
#include "common/camera/intrinsics.h"

namespace rigcal::testing {

// A blinking wand of three spheres that moves sideways in front of an event camera: discs whose
// pixels change with the light. For tests of the data flow; for sensor physics see
// common/simulation.
struct BlinkingWand {
  agent::SensorGeometry geometry{640, 480};
  double blink_hz = 500;
  double duration_s = 0.3;
  double distance_m = 2;
  double velocity_m_s = 0.5;     // along x of the camera
  double noise_per_s = 100'000;  // events
  double first_s = 0;            // the sensor's clock at the beginning
  bool visible = true;
  bool falls_only = false;  // pixels are in reset when the light rises
  std::vector<agent::TriggerEvent> triggers;  // by time

  Intrinsics CameraIntrinsics() const;
  // Of marker 0, 1 or 2 (0, 0.13 and 0.39 m along the wand, 40 mm), by the sensor's clock.
  Eigen::Vector2d CentreAt(int marker, double time_s) const;
  double RadiusPx() const;

  // A RAW file of EVT 3.0.
  std::vector<uint8_t> RawFile() const;
};

void WriteBytes(const std::string& path, const std::vector<uint8_t>& bytes);

}  // namespace rigcal::testing
