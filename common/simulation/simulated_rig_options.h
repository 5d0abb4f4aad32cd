// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/simulation/events/event_render_options.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/simulation/world/simulation_options.h"

namespace rigcal {

// A simulated rig as people type it: the world, and with `pixels=1` how its cameras see it.
struct SimulatedRigOptions {
  SimulationOptions world;
  std::optional<FrameRenderOptions> frames;  // none: the cameras yield markers
  int event_cameras = 0;                     // of the last cameras: these yield events
  EventRenderOptions sensors = {};           // of the event cameras
  double output_hz = 200;                    // how often events give the wand, 10 to 1000
  std::string event_clock = {};              // shared by all event cameras; empty: each has its own
};

// Reads `cameras=4;seed=1;pixels=1;clutter=0.5`: the options of the world, with `pixels=1` those of
// FrameRenderOptions and `events=N`, the number of event cameras among them; with these those of
// EventRenderOptions, `output=HZ` and `event_clock=NAME`. `seed` is that of all.
absl::StatusOr<SimulatedRigOptions> ParseSimulatedRigOptions(std::string_view text);

}  // namespace rigcal
