// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

// The sensor of a simulated event camera and what moves and flickers before it. Light, room, lens
// and LEDs are those of FrameRenderOptions: both kinds of cameras see one world.
//
// A pixel follows the logarithm of its light through a low pass of first order and fires when that
// has moved from the reference by a threshold (Lichtsteiner, Posch and Delbruck 2008, "A 128x128
// 120 dB 15 us latency asynchronous temporal contrast vision sensor"). It is then held in reset
// for the refractory period; the level at its end is the next reference.
struct EventRenderOptions {
  uint32_t seed = 1;  // of all noise, thresholds and clutter

  // Pixel.
  double on_threshold = 0.25;      // of ln(light), 0.01 to 5
  double off_threshold = 0.25;     // 0.01 to 5
  double threshold_spread = 0.1;   // one sigma over the pixels, relative, 0 to 0.3
  double threshold_jitter = 0.03;  // one sigma from event to event, relative, 0 to 0.3
  double refractory_us = 500;      // 0 to 1e5
  double refractory_spread = 0.1;  // one sigma over the pixels, relative, 0 to 0.3
  double latency_us = 50;          // time constant of the low pass at the LED's light, 0 to 1e4
  double latency_slowdown = 0.05;  // share of the time constant that grows as light falls, 0 to 1
  double background_hz = 5;        // noise events of each pixel, either polarity, 0 to 1000
  double shot_hz = 0;              // of each pixel in the dark, less in the light, 0 to 1000
  double leak_hz = 0.1;            // ON events of each pixel by leakage, 0 to 1000
  double hot_pixels = 20;          // 0 to 10000
  double hot_hz = 1000;            // events of each, 0 to 1e5

  // Readout: one row at a time, all its waiting events together; the rest waits.
  double row_ns = 50;   // 0 to 1e5, of a row
  double event_ns = 1;  // 0 to 1e5, of each of its events

  // Clutter: bars that cross the image and lamps.
  double bars = 2;               // 0 to 100, rectangles with two long edges
  double bar_px = 300;           // length of each edge, 1 to 2000
  double bar_px_s = 300;         // 0 to 1e4, across the edges
  double bar_contrast = 0.8;     // of ln(light), -5 to 5, either sign by turns
  double lamps = 2;              // 0 to 100, discs
  double lamp_radius_px = 12;    // 1 to 500
  double lamp_hz = 100;          // 1 to 1e4; every other lamp 1.2 times as much
  double lamp_modulation = 0.6;  // 0 to 0.99 of its mean light

  // External trigger: rises at every whole period from time 0 on, for half a period.
  double trigger_hz = 50;  // 0: none; to 1e4
  double led_phase = 0;    // 0 to 1: where in its period each LED is at time 0

  friend bool operator==(const EventRenderOptions&, const EventRenderOptions&) = default;
  // Every fault.
  absl::Status Validate() const;
};

// Reads `refractory=500;background=5;...`; every part may be left out. The names are those above
// without units: seed, on_threshold, off_threshold, threshold_spread, threshold_jitter, refractory,
// refractory_spread, latency, latency_slowdown, background, shot, leak, hot_pixels, hot_hz, row_ns,
// event_ns, bars, bar_px, bar_speed, bar_contrast, lamps, lamp_radius, lamp_hz, lamp_modulation,
// trigger_hz, led_phase. The error names the part and lists the known ones.
absl::StatusOr<EventRenderOptions> ParseEventRenderOptions(std::string_view text);
// The same notation: every part that differs from its default.
std::string FormatEventRenderOptions(const EventRenderOptions& options);
// Whether `name` (what stands before '=') is one of these. `seed` belongs to the world too.
bool IsEventRenderOption(std::string_view name);

}  // namespace rigcal
