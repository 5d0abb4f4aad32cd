// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/recording_options.h"

#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>
#include <vector>

#include "agent/capture/camera_status.h"
#include "agent/capture/source_kind.h"
#include "common/import/intrinsics_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

int64_t MiddleOfExposureNs(int64_t stamp_ns, StampMoment stamps, double exposure_s) {
  if (stamps == StampMoment::kMiddle) return stamp_ns;
  const int64_t half_ns = std::llround(0.5e9 * exposure_s);
  int64_t middle_ns = 0;
  if (stamps == StampMoment::kStart) {
    return __builtin_add_overflow(stamp_ns, half_ns, &middle_ns)
               ? std::numeric_limits<int64_t>::max()
               : middle_ns;
  }
  return __builtin_sub_overflow(stamp_ns, half_ns, &middle_ns) ? std::numeric_limits<int64_t>::min()
                                                               : middle_ns;
}

void AddStamps(StampMoment* stamps, OptionTable* table) {
  table->AddChoice(
      "stamps", stamps,
      std::vector<std::pair<std::string, StampMoment>>{{"middle", StampMoment::kMiddle},
                                                       {"start", StampMoment::kStart},
                                                       {"end", StampMoment::kEnd}},
      "what of an exposure the times are; start and end need exposure");
}

void CheckStamps(StampMoment stamps, double exposure_s, FaultList* faults) {
  if (stamps == StampMoment::kMiddle || exposure_s > 0) return;
  faults->Add(absl::StrCat("stamps=", stamps == StampMoment::kStart ? "start" : "end",
                           " needs the exposure: say exposure=SECONDS"));
}

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
      OfCamera(options.camera, ReadIntrinsicsFile(options.calibration_path, options.camera),
               absl::StrCat(
                   "; name the file of its lens with ;calibration=FILE",
                   kind == "csv" ? "" : ", or say ;calibration=none for a camera without one")));
  description.image_size_px = calibration.image_size_px;
  description.intrinsics = std::move(calibration.intrinsics);
  return description;
}

}  // namespace rigcal::agent
