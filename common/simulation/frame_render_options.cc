// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frame_render_options.h"

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
  double FrameRenderOptions::*member;
  double low;
  double high;
};
constexpr NumberOption kNumbers[] = {
    {"exposure", &FrameRenderOptions::exposure_s, 1e-5, 1},
    {"led_grey", &FrameRenderOptions::led_grey, 0, 5000},
    {"led_cd_m2", &FrameRenderOptions::led_cd_m2, 1, 1e6},
    {"led_hue", &FrameRenderOptions::led_hue_deg, 0, 360},
    {"led_saturation", &FrameRenderOptions::led_saturation, 0, 1},
    {"blink_hz", &FrameRenderOptions::blink_hz, 0, 1e5},
    {"blink_duty", &FrameRenderOptions::blink_duty, 0.001, 1},
    {"blink_drift", &FrameRenderOptions::blink_drift_ppm, -1e5, 1e5},
    {"limb", &FrameRenderOptions::limb, 0, 1},
    {"defocus", &FrameRenderOptions::defocus_px, 0, 20},
    {"defocus_disc", &FrameRenderOptions::defocus_disc_px, 0, 20},
    {"vignetting", &FrameRenderOptions::vignetting, 0, 0.9},
    {"bloom", &FrameRenderOptions::bloom, 0, 1},
    {"bloom_radius", &FrameRenderOptions::bloom_radius_px, 0.5, 50},
    {"black", &FrameRenderOptions::black_grey, 0, 100},
    {"read_noise", &FrameRenderOptions::read_noise_grey, 0, 12},
    {"electrons_per_grey", &FrameRenderOptions::electrons_per_grey, 1, 1e9},
    {"lux", &FrameRenderOptions::lux, 0, 1e5},
    {"reflectance", &FrameRenderOptions::background_reflectance, 0, 1},
    {"clutter", &FrameRenderOptions::clutter, 0, 5},
    {"reflection", &FrameRenderOptions::reflection, 0, 1},
    {"occlusion", &FrameRenderOptions::occlusion, 0, 1},
};

std::string KnownNames() {
  std::vector<std::string> names = {"seed"};
  for (const NumberOption& option : kNumbers) names.emplace_back(option.name);
  names.emplace_back("auto_gain");
  return absl::StrJoin(names, ", ");
}

absl::Status Refuse(const std::string& part, const std::string& why) {
  return absl::InvalidArgumentError(
      absl::StrCat("picture option \"", absl::CHexEscape(part.substr(0, 100)), "\" ", why));
}

absl::Status ParsePart(const std::string& part, FrameRenderOptions* options) {
  const std::vector<std::string> sides = absl::StrSplit(part, absl::MaxSplits('=', 1));
  if (sides.size() != 2) return Refuse(part, "has no value, as lux=200 has one");
  if (!IsFrameRenderOption(sides[0])) {
    return Refuse(part, absl::StrCat("is unknown, known are ", KnownNames()));
  }
  if (sides[0] == "seed") {
    if (absl::SimpleAtoi(sides[1], &options->seed)) return absl::OkStatus();
    return Refuse(part, "needs a whole number, 0 to 4294967295");
  }
  if (sides[0] == "auto_gain") {
    if (sides[1] != "0" && sides[1] != "1") return Refuse(part, "must be 0 or 1");
    options->auto_gain = sides[1] == "1";
    return absl::OkStatus();
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

absl::Status FrameRenderOptions::Validate() const {
  std::vector<std::string> faults;
  for (const NumberOption& option : kNumbers) {
    const double value = this->*option.member;
    if (value >= option.low && value <= option.high) continue;
    faults.push_back(
        absl::StrCat(option.name, " is ", value, ", it must be ", option.low, " to ", option.high));
  }
  // So that an exposure is made of a bounded number of flashes.
  if (blink_hz * exposure_s > 1000) {
    faults.push_back(absl::StrCat("exposure ", exposure_s, " s holds more than 1000 blinks of ",
                                  blink_hz, " Hz"));
  }
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("picture options: ", absl::StrJoin(faults, "; ")));
}

bool IsFrameRenderOption(std::string_view name) {
  if (name == "seed" || name == "auto_gain") return true;
  for (const NumberOption& option : kNumbers) {
    if (name == option.name) return true;
  }
  return false;
}

absl::StatusOr<FrameRenderOptions> ParseFrameRenderOptions(std::string_view text) {
  FrameRenderOptions options;
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

std::string FormatFrameRenderOptions(const FrameRenderOptions& options) {
  const FrameRenderOptions defaults;
  std::vector<std::string> parts;
  if (options.seed != defaults.seed) parts.push_back(absl::StrCat("seed=", options.seed));
  for (const NumberOption& option : kNumbers) {
    const double value = options.*option.member;
    if (value == defaults.*option.member) continue;
    parts.push_back(absl::StrCat(option.name, "=", ShortestText(value)));
  }
  if (options.auto_gain) parts.emplace_back("auto_gain=1");
  return absl::StrJoin(parts, ";");
}

}  // namespace rigcal
