// SPDX-License-Identifier: Apache-2.0
// raw:
#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "agent/capture/source_kinds.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr double kDefaultRateHz = 200;

void TakeGeometry(SourceOptions* given, std::optional<SensorGeometry>* geometry) {
  std::string text;
  given->Take("geometry", &text);
  if (text.empty()) return;
  const std::pair<std::string, std::string> sides = absl::StrSplit(text, absl::MaxSplits('x', 1));
  SensorGeometry read;
  if (absl::SimpleAtoi(sides.first, &read.width) && absl::SimpleAtoi(sides.second, &read.height)) {
    *geometry = read;
    return;
  }
  given->AddFault("geometry", "is not WIDTHxHEIGHT, such as 1280x720");
}

void TakePlainFileOptions(SourceOptions* given, PlainFileOptions* plain) {
  std::string text = "auto";
  given->Take("time", &text);
  if (const auto unit = ParseTimeUnit(text)) {
    plain->time_unit = *unit;
  } else {
    given->AddFault("time", "is none of s, us, ns and auto");
  }
  given->Take("columns", &plain->columns);
  std::string sorted = plain->columns;
  std::sort(sorted.begin(), sorted.end());
  if (sorted != "ptxy") given->AddFault("columns", "is no order of x, y, p and t, such as txyp");
}

void TakeTrigger(SourceOptions* given, OutputTimesOptions* output) {
  std::string text;
  given->Take("trigger", &text);
  if (text == "rising") {
    output->trigger = TriggerInstant::kRising;
  } else if (text == "falling") {
    output->trigger = TriggerInstant::kFalling;
  } else if (text == "middle") {
    output->trigger = TriggerInstant::kMiddle;
  } else if (!text.empty() && text != "none") {
    given->AddFault("trigger", "is none of rising, falling, middle and none");
  }
  given->Take("trigger_channel", "a channel of 0 to 31", 0, 31, &output->trigger_channel);
}

}  // namespace

void TakeBlinkOptions(SourceOptions* given, BlinkWandDetectorOptions* detector) {
  TakeTrigger(given, &detector->output);
  detector->output.rate_hz = detector->output.trigger == TriggerInstant::kNone ? kDefaultRateHz : 0;
  given->Take("rate", "a rate of 0 to 1000 Hz", 0.0, 1000.0, &detector->output.rate_hz);
  given->Take("band", "a share of 0.01 to 0.45", 0.01, 0.45, &detector->band_rel);
  given->Take("min_periods", "a number of 1 to 7", 1, 7, &detector->min_periods);
  given->Take("min_blob", "a number of pixels above 0", 1, 100'000, &detector->min_blob_pixels);
  given->Take("min_distance", "a number of metres, 0 to 1000", 0.0, 1000.0,
              &detector->min_distance_m);
  given->Take("max_distance", "a number of metres, 0 to 1000", 0.0, 1000.0,
              &detector->max_distance_m);
  given->Take("max_tilt", "an angle of 10 to 89 degrees", 10.0, 89.0, &detector->max_tilt_deg);
  given->Take("min_confidence", "a number of 0 to 1", 0.0, 1.0, &detector->min_confidence);
}

absl::StatusOr<SourceSpec> ParseRawSource(SourceText text) {
  RIGCAL_RETURN_IF_ERROR(CheckSourcePath("raw:", text.subject));
  EventSourceSpec spec;
  RawSourceOptions options;
  options.path = text.subject;
  const std::filesystem::path path(options.path);
  options.camera = text.name.empty() ? path.stem().string() : text.name;
  options.calibration_path = std::filesystem::path(path).replace_extension(".yaml").string();
  SourceOptions& given = text.options;
  given.TakeSpeed(&options.speed);
  given.Take("calibration", &options.calibration_path);
  if (options.calibration_path == "none") options.calibration_path.clear();
  TakeGeometry(&given, &options.geometry);
  TakePlainFileOptions(&given, &options.plain);
  given.Take("clock", &options.clock_id);
  TakeBlinkOptions(&given, &spec.detector);
  RIGCAL_RETURN_IF_ERROR(given.Finish());
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(spec.detector.Validate());
  spec.events = std::move(options);
  return spec;
}

}  // namespace rigcal::agent
