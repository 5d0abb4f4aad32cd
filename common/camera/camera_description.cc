// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_description.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/status/fault_list.h"
#include "common/status/validate_name.h"
#include "common/text/printable.h"

namespace rigcal {
namespace {

constexpr size_t kMaxTextLength = 256;
constexpr double kMaxLatencyS = 10;

void CheckNumber(const char* name, double value, double lowest, FaultList* faults) {
  if (std::isfinite(value) && value >= lowest) return;
  faults->Add(name, " is ", value, ", it must be finite", lowest == 0 ? " and not negative" : "");
}

void CheckText(const char* name, const std::string& text, FaultList* faults) {
  const bool printable = Printable(text) == text;
  if (text.size() > kMaxTextLength) {
    faults->Add(name, " has ", text.size(), " bytes, at most ", kMaxTextLength);
  }
  if (!printable) {
    faults->Add(name, " \"", absl::CHexEscape(text.substr(0, 64)), "\" has control characters");
  }
}

}  // namespace

absl::Status CameraSettings::Validate() const {
  FaultList faults;
  CheckText("model", model, &faults);
  CheckText("pixel_format", pixel_format, &faults);
  CheckText("trigger", trigger, &faults);
  CheckNumber("exposure_s", exposure_s, 0, &faults);
  CheckNumber("gain_db", gain_db, std::numeric_limits<double>::lowest(), &faults);
  CheckNumber("frame_rate_hz", frame_rate_hz, 0, &faults);
  return faults.Result("settings: ");
}

absl::Status CameraDescription::Validate() const {
  FaultList faults;
  faults.Add(ValidateName("name", camera));
  faults.Add(image_size_px.Validate());
  if (intrinsics) faults.Add(intrinsics->Validate(image_size_px));
  if (clock.clock_id.empty()) faults.Add("clock_id is empty: name the clock that stamps it");
  CheckText("clock_id", clock.clock_id, &faults);
  CheckText("timebase", clock.timebase, &faults);
  CheckText("source", source, &faults);
  if (settings) faults.Add(settings->Validate());
  if (!(std::abs(latency_s) <= kMaxLatencyS)) {
    faults.Add("latency_s is ", latency_s, ", it must be finite and within ", kMaxLatencyS, " s");
  }
  if (sensor != SensorKind::kUnknown && sensor != SensorKind::kFrame &&
      sensor != SensorKind::kEvent) {
    faults.Add("sensor kind ", static_cast<int>(sensor), " is unknown");
  }
  return faults.Result(absl::StrCat("camera \"", absl::CHexEscape(camera.substr(0, 64)), "\": "));
}

}  // namespace rigcal
