// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/identify/wand_mechanisms.h"
#include "common/simulation/frames/frame_renderer.h"
#include "tests/accuracy/detection/room_cases.h"

namespace rigcal::accuracy {

// One detector of those that are compared on the same frames.
struct DetectorVariant {
  std::string name;
  agent::WandMechanisms without;
  bool background = true;  // learns the static background
};

// The mechanisms that can be left out, by the names of --without.
std::vector<DetectorVariant> MechanismVariants();
// Of `a+b`: both are left out. INVALID_ARGUMENT: no such mechanism; names those there are.
absl::StatusOr<DetectorVariant> VariantWithout(const std::string& names);

struct DetectionValueOptions {
  uint32_t seed = 1;
  int camera_count = 4;
  double rate_hz = 10.01;  // of frames; no multiple of the blink's period
  double empty_s = 5;      // the room without a wand, before the wave
  double duration_s = 30;  // of the wave
  int threads = 2;
};

// A wand whose sphere is that far off is false.
inline constexpr double kFalsePx = 3;
inline constexpr double kBackgroundAfterS = 3;  // DetectingOptions::background_s

// A simulated rig, a wave in front of it, and a room around them.
struct RoomWave {
  std::shared_ptr<const SimulatedWorld> world;
  FrameRenderOptions render;
};
absl::StatusOr<RoomWave> MakeRoomWave(const DetectionValueOptions& options,
                                      const DetectionCase& room);

// The rooms of `rigcal-accuracy detection_value`.
std::vector<DetectionCase> ValueRooms();

// What a detector's rows are worth, of one condition.
struct DetectionValue {
  int frames = 0;          // of all cameras, those without a wand included
  int shown = 0;           // of them, with two spheres in the image or more
  int views = 0;           // wands that were found, of the poorest camera
  double views_share = 0;  // of its frames during the wave
  int false_wands = 0;     // where there is none, or a sphere more than 3 px off
  double rms_px = 0;       // of each coordinate
  double bias_px = 0;      // length of the mean error
  double nees = 0;         // per degree of freedom
  absl::Status solved;     // of the calibration
  double worst_mm = 0;     // largest error of a camera's position at the target's true length
  double rms_mm = 0;       // of all but the reference camera
  double median_ms = 0, worst_ms = 0;  // CPU time of a frame
};

// Waves of a simulated rig in one kind of room, rendered once, for each variant in turn.
absl::StatusOr<std::vector<DetectionValue>> RunDetectionValue(
    const DetectionValueOptions& options, const DetectionCase& room,
    const std::vector<DetectorVariant>& variants);

}  // namespace rigcal::accuracy
