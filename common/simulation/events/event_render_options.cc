// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_render_options.h"

#include "absl/strings/str_join.h"
#include "common/simulation/world/option_table.h"

namespace rigcal {
namespace {

constexpr NumberOption<EventRenderOptions> kNumbers[] = {
    {"on_threshold", &EventRenderOptions::on_threshold, 0.01, 5},
    {"off_threshold", &EventRenderOptions::off_threshold, 0.01, 5},
    {"threshold_spread", &EventRenderOptions::threshold_spread, 0, 0.3},
    {"threshold_jitter", &EventRenderOptions::threshold_jitter, 0, 0.3},
    {"refractory", &EventRenderOptions::refractory_us, 0, 1e5},
    {"refractory_spread", &EventRenderOptions::refractory_spread, 0, 0.3},
    {"latency", &EventRenderOptions::latency_us, 0, 1e4},
    {"latency_slowdown", &EventRenderOptions::latency_slowdown, 0, 1},
    {"background", &EventRenderOptions::background_hz, 0, 1000},
    {"shot", &EventRenderOptions::shot_hz, 0, 1000},
    {"leak", &EventRenderOptions::leak_hz, 0, 1000},
    {"hot_pixels", &EventRenderOptions::hot_pixels, 0, 10000},
    {"hot_hz", &EventRenderOptions::hot_hz, 0, 1e5},
    {"row_ns", &EventRenderOptions::row_ns, 0, 1e5},
    {"event_ns", &EventRenderOptions::event_ns, 0, 1e5},
    {"bars", &EventRenderOptions::bars, 0, 100},
    {"bar_px", &EventRenderOptions::bar_px, 1, 2000},
    {"bar_speed", &EventRenderOptions::bar_px_s, 0, 1e4},
    {"bar_contrast", &EventRenderOptions::bar_contrast, -5, 5},
    {"lamps", &EventRenderOptions::lamps, 0, 100},
    {"lamp_radius", &EventRenderOptions::lamp_radius_px, 1, 500},
    {"lamp_hz", &EventRenderOptions::lamp_hz, 1, 1e4},
    {"lamp_modulation", &EventRenderOptions::lamp_modulation, 0, 0.99},
    {"trigger_hz", &EventRenderOptions::trigger_hz, 0, 1e4},
    {"led_phase", &EventRenderOptions::led_phase, 0, 1},
};
constexpr OptionTable<EventRenderOptions> kTable = {
    .notation = {.kind = "event sensor option", .example = "refractory=500"},
    .numbers = kNumbers,
    .switches = {},
};

}  // namespace

absl::Status EventRenderOptions::Validate() const {
  FaultList faults;
  kTable.Check(*this, &faults);
  return faults.Result("event sensor options: ");
}

bool IsEventRenderOption(std::string_view name) { return kTable.Has(name); }

absl::StatusOr<EventRenderOptions> ParseEventRenderOptions(std::string_view text) {
  return kTable.Parse(text);
}

std::string FormatEventRenderOptions(const EventRenderOptions& options) {
  return absl::StrJoin(kTable.Format(options), ";");
}

}  // namespace rigcal
