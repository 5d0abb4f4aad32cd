// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/recording_options.h"

#include <filesystem>
#include <utility>

#include "agent/capture/camera_status.h"
#include "agent/capture/source_kind.h"
#include "common/camera/intrinsics_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

void AddOptions(RecordingOptions* options, OptionTable* table) {
  AddSpeed(&options->speed, table);
  AddCalibration(&options->calibration_path, table);
}

void ResolveOptions(const std::string& name, const std::string& subject,
                    RecordingOptions* options) {
  options->path = subject;
  options->camera = CameraNameOf(name, subject);
  ResolveCalibration(subject, &options->calibration_path);
}

absl::StatusOr<CameraDescription> DescribeRecording(const std::string& kind,
                                                    const RecordingOptions& options,
                                                    SensorKind sensor) {
  CameraDescription description;
  description.camera = options.camera;
  description.clock = {.clock_id = options.camera, .timebase = "recording"};
  description.sensor = sensor;
  description.source =
      absl::StrCat(kind, ":", std::filesystem::path(options.path).filename().string());
  if (options.calibration_path.empty()) return description;
  RIGCAL_ASSIGN_OR_RETURN(
      IntrinsicsFile calibration,
      OfCamera(options.camera, ReadIntrinsicsFile(options.calibration_path),
               absl::StrCat(
                   "; name the camera's OpenCV YAML with ;calibration=FILE",
                   kind == "csv" ? "" : ", or say ;calibration=none for a camera without one")));
  description.image_size_px = calibration.image_size_px;
  description.intrinsics = std::move(calibration.intrinsics);
  return description;
}

}  // namespace rigcal::agent
