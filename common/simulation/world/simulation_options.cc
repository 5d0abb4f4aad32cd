// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/simulation_options.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/simulation/world/option_table.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr double kMinRateHz = 0.1;
constexpr double kMaxRateHz = 1000;

constexpr NumberOption<SimulationOptions> kNumbers[] = {
    {"duration", &SimulationOptions::duration_s, 0.1, 86400, " s"},
    {"rate", &SimulationOptions::rate_hz, kMinRateHz, kMaxRateHz, " Hz"},
    {"noise", &SimulationOptions::noise_px, 0, 100, " px"},
    {"outliers", &SimulationOptions::outlier_share, 0, 1},
    {"dropouts", &SimulationOptions::dropout_share, 0, 1},
    {"swaps", &SimulationOptions::swap_share, 0, 1},
    {"wand_speed", &SimulationOptions::max_speed_m_s, 0.01, 20, " m/s"},
    {"jitter", &SimulationOptions::jitter_s, 0, 1, " s"},
    {"length_error", &SimulationOptions::length_error_m, -0.1, 0.1, " m"},
    {"length_sigma", &SimulationOptions::length_sigma_m, 0, 0.02, " m"},
    {"focal_sigma", &SimulationOptions::focal_sigma_rel, 0, 0.05},
    {"centre_sigma", &SimulationOptions::centre_sigma_px, 0, 100, " px"},
    {"radial_sigma", &SimulationOptions::radial_sigma, 0, 0.2},
    {"radial_high_sigma", &SimulationOptions::radial_high_sigma, 0, 0.2},
    {"tangential_sigma", &SimulationOptions::tangential_sigma, 0, 0.01},
    {"gap_start", &SimulationOptions::gap_start_s, 0, 86400, " s"},
    {"gap", &SimulationOptions::gap_duration_s, 0, 86400, " s"},
};
constexpr SwitchOption<SimulationOptions> kSwitches[] = {
    {"free_running", &SimulationOptions::free_running},
    {"clock_samples", &SimulationOptions::clock_samples},
};
constexpr OptionTable<SimulationOptions> kTable = {
    .notation = {.kind = "simulation option", .example = "rate=25"},
    .numbers = kNumbers,
    .switches = kSwitches,
};

// Numbers of single cameras: `offset.2=0.008`.
struct CameraOption {
  const char* name;
  std::map<int, double> SimulationOptions::*member;
  double low;
  double high;
  const char* unit = "";
};
constexpr CameraOption kCameraOptions[] = {
    {"offset", &SimulationOptions::time_offset_s, -3600, 3600, " s"},
    {"rate_ppm", &SimulationOptions::time_rate_ppm, -10000, 10000},
    {"rate", &SimulationOptions::camera_rate_hz, kMinRateHz, kMaxRateHz, " Hz"},
    {"outliers", &SimulationOptions::camera_outlier_share, 0, 1},
};

std::string KnownNames() {
  std::string names = absl::StrCat("cameras, ", kTable.Names(), ", and for camera N ");
  return absl::StrCat(
      names, absl::StrJoin(kCameraOptions, ", ", [](std::string* out, const CameraOption& option) {
        absl::StrAppend(out, option.name, ".N");
      }));
}

absl::Status TakeCameraOption(const OptionPart& part, size_t dot, SimulationOptions* options) {
  const std::string name = part.name.substr(0, dot);
  for (const CameraOption& option : kCameraOptions) {
    if (name != option.name) continue;
    int index = 0;
    if (!absl::SimpleAtoi(part.name.substr(dot + 1), &index) || index < 0) {
      return RefuseOption(kTable.notation, part.text,
                          "does not name a camera by its index, as offset.2=0.008 does");
    }
    return ParseOption(kTable.notation, part, &(options->*option.member)[index]);
  }
  return RefuseOption(kTable.notation, part.text,
                      absl::StrCat("is unknown, known are ", KnownNames()));
}

absl::Status TakePart(const OptionPart& part, SimulationOptions* options) {
  if (part.name == "cameras") {
    uint32_t whole = 0;
    RIGCAL_RETURN_IF_ERROR(ParseOption(kTable.notation, part, &whole));
    // Limited here because an int may not hold it; Validate says what is allowed.
    options->camera_count = static_cast<int>(std::min(whole, 1000000u));
    return absl::OkStatus();
  }
  if (const size_t dot = part.name.find('.'); dot != std::string::npos) {
    return TakeCameraOption(part, dot, options);
  }
  return kTable.Take(part, KnownNames(), options);
}

void CheckCameras(const SimulationOptions& options, const CameraOption& option, FaultList* faults) {
  for (const auto& [index, value] : options.*option.member) {
    if (index < 0 || index >= options.camera_count) {
      faults->Add(option.name, ".", index, " names camera ", index, " of ", options.camera_count,
                  ", they count from 0");
    }
    faults->CheckRange(absl::StrCat(option.name, ".", index), value, option.low, option.high,
                       option.unit);
  }
}

}  // namespace

absl::Status SimulationOptions::Validate() const {
  FaultList faults;
  faults.CheckRange("cameras", camera_count, 2, 100);
  kTable.Check(*this, &faults);
  for (const CameraOption& option : kCameraOptions) CheckCameras(*this, option, &faults);
  double fastest_hz = std::clamp(rate_hz, kMinRateHz, kMaxRateHz);
  for (const auto& [index, hz] : camera_rate_hz) fastest_hz = std::max(fastest_hz, hz);
  // So that stamps with jitter still increase.
  const double most_jitter_s = 0.1 / std::min(fastest_hz, kMaxRateHz);
  if (jitter_s <= 1 && jitter_s > most_jitter_s) {
    faults.Add("jitter is ", jitter_s, " s, at these rates at most ", most_jitter_s, " s");
  }
  return faults.Result("simulation options: ");
}

absl::StatusOr<SimulationOptions> ParseSimulationOptions(std::string_view text) {
  SimulationOptions options;
  bool has_wand_speed = false;
  const auto take = [&](OptionPart part) {
    if (part.name == "speed") part.name = "wand_speed";
    if (part.name == "wand_speed" && std::exchange(has_wand_speed, true)) {
      return RefuseOption(kTable.notation, part.text, "is given twice");
    }
    return TakePart(part, &options);
  };
  RIGCAL_RETURN_IF_ERROR(ForEachOptionPart(kTable.notation, text, take));
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  return options;
}

std::string FormatSimulationOptions(const SimulationOptions& options) {
  std::vector<std::string> parts = kTable.Format(options);
  // Always told: what a world is known by.
  if (options.seed == SimulationOptions().seed)
    parts.insert(parts.begin(), absl::StrCat("seed=", options.seed));
  parts.insert(parts.begin() + 1, absl::StrCat("cameras=", options.camera_count));
  for (const CameraOption& option : kCameraOptions) {
    for (const auto& [index, value] : options.*option.member) {
      parts.push_back(absl::StrCat(option.name, ".", index, "=", ShortestText(value)));
    }
  }
  return absl::StrJoin(parts, ";");
}

}  // namespace rigcal
