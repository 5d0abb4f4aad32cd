// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_render_options.h"

#include "common/options/option_table.h"

namespace rigcal {

void AddOptions(EventRenderOptions* options, OptionTable* table) {
  EventRenderOptions& o = *options;
  table->Add("seed", &o.seed, {0, 4294967295}, "of all noise, thresholds and clutter");
  table->Add("on_threshold", &o.on_threshold, {0.01, 5}, "of ln(light)");
  table->Add("off_threshold", &o.off_threshold, {0.01, 5}, "of ln(light)");
  table->Add("threshold_spread", &o.threshold_spread, {0, 0.3}, "over the pixels, relative");
  table->Add("threshold_jitter", &o.threshold_jitter, {0, 0.3}, "between events, relative");
  table->Add("refractory", &o.refractory_us, {0, 1e5, "us"}, "a pixel is silent after an event");
  table->Add("refractory_spread", &o.refractory_spread, {0, 0.3}, "over the pixels, relative");
  table->Add("latency", &o.latency_us, {0, 1e4, "us"}, "time constant at the LED's light");
  table->Add("latency_slowdown", &o.latency_slowdown, {0, 1}, "share that grows as light falls");
  table->Add("background", &o.background_hz, {0, 1000, "Hz"}, "noise events of each pixel");
  table->Add("shot", &o.shot_hz, {0, 1000, "Hz"}, "noise of a pixel in the dark");
  table->Add("leak", &o.leak_hz, {0, 1000, "Hz"}, "ON events of each pixel by leakage");
  table->Add("hot_pixels", &o.hot_pixels, {0, 10000}, "how many there are");
  table->Add("hot_hz", &o.hot_hz, {0, 1e5, "Hz"}, "events of each hot pixel");
  table->Add("row_ns", &o.row_ns, {0, 1e5, "ns"}, "to read out a row");
  table->Add("event_ns", &o.event_ns, {0, 1e5, "ns"}, "to read out each of its events");
  table->Add("bars", &o.bars, {0, 100}, "that cross the image");
  table->Add("bar_px", &o.bar_px, {1, 2000, "px"}, "length of their edges");
  table->Add("bar_speed", &o.bar_px_s, {0, 1e4, "px/s"}, "across their edges");
  table->Add("bar_contrast", &o.bar_contrast, {-5, 5}, "of ln(light)");
  table->Add("lamps", &o.lamps, {0, 100}, "flickering discs");
  table->Add("lamp_radius", &o.lamp_radius_px, {1, 500, "px"}, "of a lamp");
  table->Add("lamp_hz", &o.lamp_hz, {1, 1e4, "Hz"}, "every other lamp 1.2 times as fast");
  table->Add("lamp_modulation", &o.lamp_modulation, {0, 0.99}, "of its mean light");
  table->Add("trigger_hz", &o.trigger_hz, {0, 1e4, "Hz"}, "external trigger; 0: none");
  table->Add("led_phase", &o.led_phase, {0, 1}, "of each LED at time 0");
}

absl::Status EventRenderOptions::Validate() const {
  FaultList faults;
  CheckOptions(*this, &faults);
  return faults.Result("event sensor options: ");
}

}  // namespace rigcal
