// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "common/camera/camera_description.h"
#include "common/options/option_table.h"

namespace rigcal::agent {

// What of an exposure the stamps of a recording are. Times are those of its middle.
enum class StampMoment : uint8_t { kMiddle, kStart, kEnd };

// The middle of an exposure, by its stamp; held at the ends of what 64 bits can say.
int64_t MiddleOfExposureNs(int64_t stamp_ns, StampMoment stamps, double exposure_s);
void AddStamps(StampMoment* stamps, OptionTable* table);
// Stamps of the start or the end say nothing of the middle without the exposure.
void CheckStamps(StampMoment stamps, double exposure_s, FaultList* faults);

// One camera of a recording, whatever was recorded.
struct RecordingOptions {
  std::string camera;            // name within the rig
  std::string path;              // of the file or folder
  std::string calibration_path;  // OpenCV YAML with intrinsics and image size; empty: none
  double speed = 1;              // multiple of the recorded pace, > 0; kMaxSpeed: no waiting
};

void AddOptions(RecordingOptions* options, OptionTable* table);
void ResolveOptions(const std::string& name, const std::string& subject, RecordingOptions* options);

// INVALID_ARGUMENT with `faults` and every other fault of the options.
template <typename Options>
absl::Status ValidateRecording(const Options& options, FaultList faults = {}) {
  if (options.camera.empty()) faults.Add("the camera's name is empty");
  if (options.path.empty()) faults.Add("the path of the recording is empty");
  CheckOptions(options, &faults);
  return faults.Result(absl::StrCat("camera ", options.camera, ": "));
}

// The camera as its own clock of time base "recording", with the intrinsics and the image size of
// its calibration, if there is one. `kind`: "csv". Errors of the calibration name the camera and
// what to do.
absl::StatusOr<CameraDescription> DescribeRecording(const std::string& kind,
                                                    const RecordingOptions& options,
                                                    SensorKind sensor);

}  // namespace rigcal::agent
