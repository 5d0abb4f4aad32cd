// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "absl/status/status.h"

namespace rigcal {

class OptionTable;

// The sensor of a simulated event camera and what moves and flickers before it. Light, room, lens
// and LEDs are those of FrameRenderOptions: both kinds of cameras see one world. Ranges: see
// AddOptions.
//
// A pixel follows the logarithm of its light through a low pass of first order and fires when that
// has moved from the reference by a threshold (Lichtsteiner, Posch and Delbruck 2008, "A 128x128
// 120 dB 15 us latency asynchronous temporal contrast vision sensor"). It is then held in reset
// for the refractory period; the level at its end is the next reference.
struct EventRenderOptions {
  uint32_t seed = 1;  // of all noise, thresholds and clutter

  // Pixel.
  double on_threshold = 0.25;  // of ln(light)
  double off_threshold = 0.25;
  double threshold_spread = 0.1;   // one sigma over the pixels, relative
  double threshold_jitter = 0.03;  // one sigma from event to event, relative
  double refractory_us = 500;
  double refractory_spread = 0.1;  // one sigma over the pixels, relative
  double latency_us = 50;          // time constant of the low pass at the LED's light
  double latency_slowdown = 0.05;  // share of the time constant that grows as light falls
  double background_hz = 5;        // noise events of each pixel, either polarity
  double shot_hz = 0;              // of each pixel in the dark, less in the light
  double leak_hz = 0.1;            // ON events of each pixel by leakage
  double hot_pixels = 20;
  double hot_hz = 1000;  // events of each

  // Readout: one row at a time, all its waiting events together; the rest waits.
  double row_ns = 50;   // of a row
  double event_ns = 1;  // of each of its events

  // Clutter: bars that cross the image, and lamps, each on one of three phases of the mains: those
  // of one frequency are whole thirds of a period apart, in the view of every camera.
  double bars = 2;            // rectangles with two long edges
  double bar_px = 300;        // length of each edge
  double bar_px_s = 300;      // across the edges
  double bar_contrast = 0.8;  // of ln(light), either sign by turns
  double lamps = 2;           // discs
  double lamp_radius_px = 12;
  double lamp_hz = 100;          // every other lamp 1.2 times as much
  double lamp_modulation = 0.6;  // of its mean light

  // External trigger: rises at every whole period from time 0 on, for half a period.
  double trigger_hz = 50;  // 0: none
  double led_phase = 0;    // where in its period each LED is at time 0

  friend bool operator==(const EventRenderOptions&, const EventRenderOptions&) = default;
  // Every fault.
  absl::Status Validate() const;
};

void AddOptions(EventRenderOptions* options, OptionTable* table);

}  // namespace rigcal
