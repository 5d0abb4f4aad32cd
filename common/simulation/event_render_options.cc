// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/event_render_options.h"

#include <charconv>
#include <cmath>
#include <set>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

struct NumberOption {
  const char* name;
  double EventRenderOptions::*member;
  double low;
  double high;
};
constexpr NumberOption kNumbers[] = {
    {"on_threshold", &EventRenderOptions::on_threshold, 0.01, 5},
    {"off_threshold", &EventRenderOptions::off_threshold, 0.01, 5},
    {"threshold_spread", &EventRenderOptions::threshold_spread, 0, 0.3},
    {"threshold_jitter", &EventRenderOptions::threshold_jitter, 0, 0.3},
    {"refractory", &EventRenderOptions::refractory_us, 0, 1e5},
    {"refractory_spread", &EventRenderOptions::refractory_spread, 0, 0.3},
    {"latency", &EventRenderOptions::latency_us, 0, 1e4},
    {"latency_slowdown", &EventRenderOptions::latency_slowdown, 0, 1},
    {"background", &EventRenderOptions::background_hz, 0, 1000},
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

std::string KnownNames() {
  std::vector<std::string> names = {"seed"};
  for (const NumberOption& option : kNumbers) names.emplace_back(option.name);
  return absl::StrJoin(names, ", ");
}

absl::Status Refuse(const std::string& part, const std::string& why) {
  return absl::InvalidArgumentError(
      absl::StrCat("event sensor option \"", absl::CHexEscape(part.substr(0, 100)), "\" ", why));
}

absl::Status ParsePart(const std::string& part, EventRenderOptions* options) {
  const std::vector<std::string> sides = absl::StrSplit(part, absl::MaxSplits('=', 1));
  if (sides.size() != 2) return Refuse(part, "has no value, as refractory=500 has one");
  if (!IsEventRenderOption(sides[0])) {
    return Refuse(part, absl::StrCat("is unknown, known are ", KnownNames()));
  }
  if (sides[0] == "seed") {
    if (absl::SimpleAtoi(sides[1], &options->seed)) return absl::OkStatus();
    return Refuse(part, "needs a whole number, 0 to 4294967295");
  }
  double value = 0;
  if (!absl::SimpleAtod(sides[1], &value) || !std::isfinite(value)) {
    return Refuse(part, "needs a finite number");
  }
  for (const NumberOption& option : kNumbers) {
    if (sides[0] == option.name) options->*option.member = value;
  }
  return absl::OkStatus();
}

std::string ShortestText(double value) {
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof(buffer), value);
  return std::string(buffer, end.ptr);
}

}  // namespace

absl::Status EventRenderOptions::Validate() const {
  std::vector<std::string> faults;
  for (const NumberOption& option : kNumbers) {
    const double value = this->*option.member;
    if (value >= option.low && value <= option.high) continue;
    faults.push_back(
        absl::StrCat(option.name, " is ", value, ", it must be ", option.low, " to ", option.high));
  }
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("event sensor options: ", absl::StrJoin(faults, "; ")));
}

bool IsEventRenderOption(std::string_view name) {
  if (name == "seed") return true;
  for (const NumberOption& option : kNumbers) {
    if (name == option.name) return true;
  }
  return false;
}

absl::StatusOr<EventRenderOptions> ParseEventRenderOptions(std::string_view text) {
  EventRenderOptions options;
  std::set<std::string> seen;
  for (absl::string_view piece : absl::StrSplit(absl::string_view(text.data(), text.size()), ';')) {
    const std::string part(absl::StripAsciiWhitespace(piece));
    if (part.empty()) continue;
    if (!seen.insert(part.substr(0, part.find('='))).second) return Refuse(part, "is given twice");
    RIGCAL_RETURN_IF_ERROR(ParsePart(part, &options));
  }
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  return options;
}

std::string FormatEventRenderOptions(const EventRenderOptions& options) {
  const EventRenderOptions defaults;
  std::vector<std::string> parts;
  if (options.seed != defaults.seed) parts.push_back(absl::StrCat("seed=", options.seed));
  for (const NumberOption& option : kNumbers) {
    const double value = options.*option.member;
    if (value == defaults.*option.member) continue;
    parts.push_back(absl::StrCat(option.name, "=", ShortestText(value)));
  }
  return absl::StrJoin(parts, ";");
}

}  // namespace rigcal
