// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "server/associate/camera_track.h"

namespace rigcal::server {

inline constexpr int64_t kRandomTrackPeriodNs = 40'000'000;
inline constexpr int kRandomTrackRows = 200;

// Two markers at pixels that no other seed has; of every tenth row none is seen.
inline CameraTrack RandomTrack(const std::string& camera, int seed) {
  CameraTrack track;
  track.session_id = "s";
  track.camera.camera = camera;
  std::mt19937 random(static_cast<unsigned>(seed));
  std::uniform_real_distribution<double> at_px(0, 1000);
  for (int i = 0; i < kRandomTrackRows; ++i) {
    Observation row;
    row.time_ns = i * kRandomTrackPeriodNs;
    row.markers.resize(2);
    for (MarkerObservation& marker : row.markers) {
      marker.visible = i % 10 != 9;
      marker.centre_px = {at_px(random), at_px(random)};
    }
    track.observations.push_back(row);
  }
  return track;
}

}  // namespace rigcal::server
