// SPDX-License-Identifier: Apache-2.0
// metavision:
#include <string>
#include <utility>

#include "agent/capture/source_kinds.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// The last part of "integrator:plugin:serial".
std::string DefaultName(const std::string& serial) {
  const std::string last = serial.substr(serial.rfind(':') + 1);  // npos + 1 is 0
  return last.empty() ? "metavision" : last;
}

void TakeSync(SourceOptions* given, std::optional<EventCameraSync>* sync) {
  std::string text;
  given->Take("sync", &text);
  if (text.empty()) return;
  const absl::StatusOr<EventCameraSync> read = ParseEventCameraSync(text);
  if (read.ok()) {
    *sync = *read;
  } else {
    given->AddFault("sync", "is none of standalone, primary and secondary");
  }
}

}  // namespace

absl::StatusOr<SourceSpec> ParseMetavisionSource(SourceText text) {
  EventSourceSpec spec;
  MetavisionSourceOptions options;
  SourceOptions& given = text.options;
  given.Take("serial", &options.serial);
  options.camera = text.name.empty() ? DefaultName(options.serial) : text.name;
  given.Take("biases", &options.settings_path);
  TakeSync(&given, &options.sync);
  given.Take("primary_delay", "a time of 0 to 60 s", 0.0, 60.0, &options.primary_delay_s);
  given.Take("clock", &options.clock_id);
  given.Take("calibration", &options.calibration_path);
  if (options.calibration_path == "none") options.calibration_path.clear();
  given.Take("latency", "a time of -10 to 10 s", -10.0, 10.0, &options.latency_s);
  TakeBlinkOptions(&given, &spec.detector);
  options.uses_triggers = spec.detector.output.trigger != TriggerInstant::kNone;
  options.trigger_channel = spec.detector.output.trigger_channel;
  RIGCAL_RETURN_IF_ERROR(given.Finish());
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(spec.detector.Validate());
  spec.events = std::move(options);
  return spec;
}

}  // namespace rigcal::agent
