// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "agent/capture/source_options.h"
#include "agent/capture/source_spec.h"

// The kinds of sources, each with the function that reads what is typed behind it. For
// source_spec.cc and its tests.
namespace rigcal::agent {

struct SourceText {
  std::string name;     // of the camera, as typed before '='; empty: the kind makes one
  std::string subject;  // what stands behind the kind up to the first ';': a path, a device
  SourceOptions options;
};

struct SourceKind {
  std::string_view prefix;  // "csv:"
  bool has_subject = true;
  std::string_view example;
  // INVALID_ARGUMENT with every fault, without saying which source it is.
  absl::StatusOr<SourceSpec> (*parse)(SourceText text);
};

absl::StatusOr<SourceSpec> ParseCsvSource(SourceText text);
absl::StatusOr<SourceSpec> ParseImagesSource(SourceText text);
absl::StatusOr<SourceSpec> ParseVideoSource(SourceText text);
absl::StatusOr<SourceSpec> ParseAravisSource(SourceText text);
absl::StatusOr<SourceSpec> ParseRawSource(SourceText text);
absl::StatusOr<SourceSpec> ParseMetavisionSource(SourceText text);
// Observations, or with pixels=1 pictures and a detector.
absl::StatusOr<SourceSpec> ParseSimulatedSource(SourceText text);

// What every source of pictures takes: how the wand is found in them.
void TakeDetectingOptions(SourceOptions* options, DetectingOptions* detecting);
// What every source of events takes.
void TakeBlinkOptions(SourceOptions* options, BlinkWandDetectorOptions* detector);

// INVALID_ARGUMENT: no path, or one that is not UTF-8. `kind` with its colon.
absl::Status CheckSourcePath(std::string_view kind, const std::string& path);

}  // namespace rigcal::agent
