// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace rigcal::accuracy {

// Waves of a wand that sends its light code before cameras whose clocks are up to a day apart.
struct LightCodeOptions {
  int seeds = 10;
  int first_seed = 1;
  int threads = 2;
  double duration_s = 10;
  int frame_cameras = 3;  // of 24 to 120 frames a second
  int event_cameras = 1;
  std::string room;  // options of the renderer, "lux=300;clutter=1"
};

struct LightCodeWave {
  uint32_t seed = 0;
  absl::Status status;  // of rendering and detection
  absl::Status solved;
  uint32_t wand = 0;
  double wand_rate = 1;                  // of its clock; 0.98 to 1.02 in every fifth wave
  int cameras = 0, read = 0, wrong = 0;  // that have read a code; and those, another wand or time
  // Of two cameras, by the code alone: the largest error of their offset, and what it is in frames
  // of the slower one. -1: fewer than two have read it.
  double coarse_s = -1, coarse_frames = -1;
  // After the solve, of any two frame cameras; and of any two at all, where the time that the
  // pixels of event cameras take to answer is in it. -1: it failed.
  double solved_s = -1, solved_events_s = -1;
  double read_after_s = 0;  // of the wave, until the last camera had read it
};

std::vector<LightCodeWave> RunLightCode(const LightCodeOptions& options);

}  // namespace rigcal::accuracy
