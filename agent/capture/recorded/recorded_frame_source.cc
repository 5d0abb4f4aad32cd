// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/recorded_frame_source.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <system_error>

#include "agent/capture/image_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

absl::Status RecordedFramesOptions::Validate() const {
  FaultList faults;
  CheckStamps(stamps, exposure_s, &faults);
  return ValidateRecording(*this, std::move(faults));
}

absl::StatusOr<CameraDescription> DescribeRecordedFrames(const std::string& kind,
                                                         const RecordedFramesOptions& options,
                                                         cv::Size image_size,
                                                         const std::string& file) {
  RIGCAL_ASSIGN_OR_RETURN(CameraDescription description,
                          DescribeRecording(kind, options, SensorKind::kFrame));
  const ImageSize size{static_cast<uint32_t>(image_size.width),
                       static_cast<uint32_t>(image_size.height)};
  const ImageSize calibrated = std::exchange(description.image_size_px, size);
  if (description.intrinsics && calibrated != size) {
    return absl::InvalidArgumentError(absl::StrCat(
        "camera ", options.camera, ": ", file, " is ", size.width, "x", size.height,
        " pixels, but the calibration ", options.calibration_path, " is one for ", calibrated.width,
        "x", calibrated.height, "; calibrate the camera at this size or name the right file"));
  }
  if (options.exposure_s > 0) description.settings.emplace().exposure_s = options.exposure_s;
  RIGCAL_RETURN_IF_ERROR(description.Validate());
  return description;
}

absl::StatusOr<FrameTimes> RecordedFrameSource::ReadTimes(const std::string& usual) {
  std::string path = options_.timestamps_path;
  std::error_code error;
  if (path.empty() && std::filesystem::exists(usual, error)) path = usual;
  if (path.empty()) return FrameTimes();
  RIGCAL_ASSIGN_OR_RETURN(FrameTimes times, ReadImageTimes(path));
  times.is_there = true;
  for (const Refusal& refusal : times.refused.List()) refused_.Add(refusal);
  return times;
}

bool RecordedFrameSource::HasRightSize(const cv::Mat& image, const std::string& name) {
  const ImageSize& right = description_.image_size_px;
  if (image.cols == static_cast<int>(right.width) && image.rows == static_cast<int>(right.height)) {
    return true;
  }
  Refuse(RefusalReason::kFrameWrongSize,
         absl::StrCat(name, " is ", image.cols, "x", image.rows,
                      " pixels, but the camera's frames are ", right.width, "x", right.height));
  return false;
}

Frame RecordedFrameSource::MakeFrame(int64_t time_ns, uint32_t clock_epoch,
                                     const std::string& file) {
  ++counts_.received;
  return {.image = ViewOf(image_),
          .time_ns = MiddleOfExposureNs(time_ns, options_.stamps, options_.exposure_s),
          .clock_epoch = clock_epoch,
          .exposure_s = options_.exposure_s,
          .file = file};
}

void RecordedFrameSource::Refuse(RefusalReason reason, const std::string& what) {
  spdlog::debug("camera {}: {}: {}", options_.camera, NameOf(reason), what);
  refused_.Add("", reason, 1, what);
  ++counts_.damaged;
}

}  // namespace rigcal::agent
