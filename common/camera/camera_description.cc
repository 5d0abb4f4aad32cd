// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_description.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/camera/camera_id.h"

namespace rigcal {
namespace {

constexpr size_t kMaxTextLength = 256;
constexpr double kMaxLatencyS = 10;

void AddFault(const absl::Status& status, std::vector<std::string>* faults) {
  if (!status.ok()) faults->emplace_back(status.message());
}

void CheckNumber(const char* name, double value, double lowest, std::vector<std::string>* faults) {
  if (std::isfinite(value) && value >= lowest) return;
  faults->push_back(absl::StrCat(name, " is ", value, ", it must be finite",
                                 lowest == 0 ? " and not negative" : ""));
}

void CheckText(const char* name, const std::string& text, std::vector<std::string>* faults) {
  const bool printable = std::all_of(text.begin(), text.end(), [](char c) {
    return !absl::ascii_iscntrl(static_cast<unsigned char>(c));
  });
  if (text.size() > kMaxTextLength) {
    faults->push_back(absl::StrCat(name, " has ", text.size(), " bytes, at most ", kMaxTextLength));
  }
  if (!printable) {
    faults->push_back(absl::StrCat(name, " \"", absl::CHexEscape(text.substr(0, 64)),
                                   "\" has control characters"));
  }
}

}  // namespace

absl::Status CameraSettings::Validate() const {
  std::vector<std::string> faults;
  CheckText("model", model, &faults);
  CheckText("pixel_format", pixel_format, &faults);
  CheckText("trigger", trigger, &faults);
  CheckNumber("exposure_s", exposure_s, 0, &faults);
  CheckNumber("gain_db", gain_db, std::numeric_limits<double>::lowest(), &faults);
  CheckNumber("frame_rate_hz", frame_rate_hz, 0, &faults);
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("settings: ", absl::StrJoin(faults, "; ")));
}

absl::Status CameraDescription::Validate() const {
  std::vector<std::string> faults;
  AddFault(ValidateName("name", camera), &faults);
  AddFault(image_size_px.Validate(), &faults);
  if (intrinsics) AddFault(intrinsics->Validate(image_size_px), &faults);
  if (clock.clock_id.empty()) faults.push_back("clock_id is empty: name the clock that stamps it");
  CheckText("clock_id", clock.clock_id, &faults);
  CheckText("timebase", clock.timebase, &faults);
  CheckText("source", source, &faults);
  if (settings) AddFault(settings->Validate(), &faults);
  if (!(std::abs(latency_s) <= kMaxLatencyS)) {
    faults.push_back(absl::StrCat("latency_s is ", latency_s, ", it must be finite and within ",
                                  kMaxLatencyS, " s"));
  }
  if (sensor != SensorKind::kUnknown && sensor != SensorKind::kFrame &&
      sensor != SensorKind::kEvent) {
    faults.push_back(absl::StrCat("sensor kind ", static_cast<int>(sensor), " is unknown"));
  }
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "camera \"", absl::CHexEscape(camera.substr(0, 64)), "\": ", absl::StrJoin(faults, "; ")));
}

}  // namespace rigcal
