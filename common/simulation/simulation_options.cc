// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/simulation_options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <set>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace rigcal {
namespace {

constexpr char kKnown[] =
    "seed, cameras, duration, rate, noise, outliers, dropouts, swaps, wand_speed, jitter, "
    "length_error, length_sigma, focal_sigma, centre_sigma, radial_sigma, radial_high_sigma, "
    "tangential_sigma, "
    "gap_start, gap, free_running, clock_samples, and for camera N offset.N, rate_ppm.N, rate.N, "
    "outliers.N";

struct NumberOption {
  const char* name;
  double SimulationOptions::*member;
};
constexpr NumberOption kNumbers[] = {
    {"duration", &SimulationOptions::duration_s},
    {"rate", &SimulationOptions::rate_hz},
    {"noise", &SimulationOptions::noise_px},
    {"outliers", &SimulationOptions::outlier_share},
    {"dropouts", &SimulationOptions::dropout_share},
    {"swaps", &SimulationOptions::swap_share},
    {"wand_speed", &SimulationOptions::max_speed_m_s},
    {"jitter", &SimulationOptions::jitter_s},
    {"length_error", &SimulationOptions::length_error_m},
    {"length_sigma", &SimulationOptions::length_sigma_m},
    {"focal_sigma", &SimulationOptions::focal_sigma_rel},
    {"centre_sigma", &SimulationOptions::centre_sigma_px},
    {"radial_sigma", &SimulationOptions::radial_sigma},
    {"radial_high_sigma", &SimulationOptions::radial_high_sigma},
    {"tangential_sigma", &SimulationOptions::tangential_sigma},
    {"gap_start", &SimulationOptions::gap_start_s},
    {"gap", &SimulationOptions::gap_duration_s},
};

struct SwitchOption {
  const char* name;
  bool SimulationOptions::*member;
};
constexpr SwitchOption kSwitches[] = {
    {"free_running", &SimulationOptions::free_running},
    {"clock_samples", &SimulationOptions::clock_samples},
};

struct CameraOption {
  const char* name;
  std::map<int, double> SimulationOptions::*member;
};
constexpr CameraOption kCameraOptions[] = {
    {"offset", &SimulationOptions::time_offset_s},
    {"rate_ppm", &SimulationOptions::time_rate_ppm},
    {"rate", &SimulationOptions::camera_rate_hz},
    {"outliers", &SimulationOptions::camera_outlier_share},
};

absl::Status Refuse(const std::string& part, const std::string& why) {
  return absl::InvalidArgumentError(
      absl::StrCat("simulation option \"", absl::CHexEscape(part.substr(0, 100)), "\" ", why));
}

absl::Status ParseCameraOption(const std::string& part, const std::string& name,
                               const std::string& index_text, double value,
                               SimulationOptions* options) {
  int index = 0;
  if (!absl::SimpleAtoi(index_text, &index) || index < 0) {
    return Refuse(part, "does not name a camera by its index, as offset.2=0.008 does");
  }
  for (const CameraOption& option : kCameraOptions) {
    if (name != option.name) continue;
    (options->*option.member)[index] = value;
    return absl::OkStatus();
  }
  return Refuse(part, absl::StrCat("is unknown, known are ", kKnown));
}

absl::Status ParsePart(const std::string& part, SimulationOptions* options) {
  const std::vector<std::string> sides = absl::StrSplit(part, absl::MaxSplits('=', 1));
  if (sides.size() != 2) return Refuse(part, "has no value, as rate=25 has one");
  const std::string& name = sides[0];
  double value = 0;
  if (!absl::SimpleAtod(sides[1], &value) || !std::isfinite(value)) {
    return Refuse(part, "needs a finite number");
  }
  if (const size_t dot = name.find('.'); dot != std::string::npos) {
    return ParseCameraOption(part, name.substr(0, dot), name.substr(dot + 1), value, options);
  }
  if (name == "seed" || name == "cameras") {
    uint32_t whole = 0;
    if (!absl::SimpleAtoi(sides[1], &whole)) return Refuse(part, "needs a whole number");
    if (name == "seed") options->seed = whole;
    // Limited here because an int may not hold it; Validate says what is allowed.
    if (name == "cameras") options->camera_count = static_cast<int>(std::min(whole, 1000000u));
    return absl::OkStatus();
  }
  for (const NumberOption& option : kNumbers) {
    if (name != option.name) continue;
    options->*option.member = value;
    return absl::OkStatus();
  }
  for (const SwitchOption& option : kSwitches) {
    if (name != option.name) continue;
    if (sides[1] != "0" && sides[1] != "1") return Refuse(part, "must be 0 or 1");
    options->*option.member = sides[1] == "1";
    return absl::OkStatus();
  }
  return Refuse(part, absl::StrCat("is unknown, known are ", kKnown));
}

std::string ShortestText(double value) {
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof(buffer), value);
  return std::string(buffer, end.ptr);
}

class RangeChecker {
 public:
  void Check(const std::string& name, double value, double low, double high) {
    if (value >= low && value <= high) return;
    faults_.push_back(absl::StrCat(name, " is ", value, ", it must be ", low, " to ", high));
  }
  void CheckCameras(const char* name, const std::map<int, double>& values, int camera_count,
                    double low, double high) {
    for (const auto& [index, value] : values) {
      if (index < 0 || index >= camera_count) {
        faults_.push_back(absl::StrCat(name, ".", index, " names camera ", index, " of ",
                                       camera_count, ", they count from 0"));
      }
      Check(absl::StrCat(name, ".", index), value, low, high);
    }
  }
  absl::Status Result() const {
    if (faults_.empty()) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat("simulation options: ", absl::StrJoin(faults_, "; ")));
  }

 private:
  std::vector<std::string> faults_;
};

}  // namespace

absl::Status SimulationOptions::Validate() const {
  constexpr double kMinRateHz = 0.1;
  constexpr double kMaxRateHz = 1000;
  RangeChecker checker;
  checker.Check("cameras", camera_count, 2, 100);
  checker.Check("duration (s)", duration_s, 0.1, 86400);
  checker.Check("rate (Hz)", rate_hz, kMinRateHz, kMaxRateHz);
  checker.Check("noise (px)", noise_px, 0, 100);
  checker.Check("outliers (share)", outlier_share, 0, 1);
  checker.Check("dropouts (share)", dropout_share, 0, 1);
  checker.Check("swaps (share)", swap_share, 0, 1);
  checker.Check("wand_speed (m/s)", max_speed_m_s, 0.01, 20);
  checker.Check("length_error (m)", length_error_m, -0.1, 0.1);
  checker.Check("length_sigma (m)", length_sigma_m, 0, 0.02);
  checker.Check("focal_sigma (relative)", focal_sigma_rel, 0, 0.05);
  checker.Check("centre_sigma (px)", centre_sigma_px, 0, 100);
  checker.Check("radial_sigma", radial_sigma, 0, 0.2);
  checker.Check("radial_high_sigma", radial_high_sigma, 0, 0.2);
  checker.Check("tangential_sigma", tangential_sigma, 0, 0.01);
  checker.Check("gap_start (s)", gap_start_s, 0, 86400);
  checker.Check("gap (s)", gap_duration_s, 0, 86400);
  checker.CheckCameras("offset", time_offset_s, camera_count, -3600, 3600);
  checker.CheckCameras("rate_ppm", time_rate_ppm, camera_count, -10000, 10000);
  checker.CheckCameras("rate", camera_rate_hz, camera_count, kMinRateHz, kMaxRateHz);
  checker.CheckCameras("outliers", camera_outlier_share, camera_count, 0, 1);
  double fastest_hz = std::clamp(rate_hz, kMinRateHz, kMaxRateHz);
  for (const auto& [index, hz] : camera_rate_hz) fastest_hz = std::max(fastest_hz, hz);
  // So that stamps with jitter still increase.
  checker.Check("jitter (s)", jitter_s, 0, 0.1 / std::min(fastest_hz, kMaxRateHz));
  return checker.Result();
}

absl::StatusOr<SimulationOptions> ParseSimulationOptions(std::string_view text) {
  SimulationOptions options;
  std::set<std::string> seen;
  for (absl::string_view piece : absl::StrSplit(absl::string_view(text.data(), text.size()), ';')) {
    std::string part(absl::StripAsciiWhitespace(piece));
    if (part.empty()) continue;
    if (absl::StartsWith(part, "speed=")) part = absl::StrCat("wand_", part);
    if (!seen.insert(part.substr(0, part.find('='))).second) {
      return Refuse(part, "is given twice");
    }
    const absl::Status status = ParsePart(part, &options);
    if (!status.ok()) return status;
  }
  const absl::Status valid = options.Validate();
  if (!valid.ok()) return valid;
  return options;
}

std::string FormatSimulationOptions(const SimulationOptions& options) {
  const SimulationOptions defaults;
  std::vector<std::string> parts = {absl::StrCat("seed=", options.seed),
                                    absl::StrCat("cameras=", options.camera_count)};
  for (const NumberOption& option : kNumbers) {
    if (options.*option.member == defaults.*option.member) continue;
    parts.push_back(absl::StrCat(option.name, "=", ShortestText(options.*option.member)));
  }
  for (const SwitchOption& option : kSwitches) {
    if (options.*option.member) parts.push_back(absl::StrCat(option.name, "=1"));
  }
  for (const CameraOption& option : kCameraOptions) {
    for (const auto& [index, value] : options.*option.member) {
      parts.push_back(absl::StrCat(option.name, ".", index, "=", ShortestText(value)));
    }
  }
  return absl::StrJoin(parts, ";");
}

}  // namespace rigcal
