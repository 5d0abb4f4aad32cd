// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/recorded_frame_source.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/image_file.h"
#include "agent/capture/source_kind.h"
#include "common/camera/intrinsics_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

void AddOptions(RecordedFramesOptions* options, OptionTable* table) {
  AddSpeed(&options->speed, table);
  AddCalibration(&options->calibration_path, table);
  table->AddPath("timestamps", &options->timestamps_path,
                 "times of the frames: name;timestamp_ns, or one timestamp_ns per line for video");
  table->Add("fps", &options->fps, {kAboveZero, 1e6, "Hz"},
             "frame rate, if the recording has no times");
  table->Add("exposure", &options->exposure_s, {0, 10, "s"}, "of every frame; 0: not known");
}

absl::Status RecordedFramesOptions::Validate() const {
  FaultList faults;
  if (camera.empty()) faults.Add("the camera's name is empty");
  if (path.empty()) faults.Add("the path of the recording is empty");
  CheckOptions(*this, &faults);
  return faults.Result(absl::StrCat("camera ", camera, ": "));
}

absl::StatusOr<CameraDescription> DescribeRecordedCamera(const std::string& camera,
                                                         const std::string& calibration_path,
                                                         cv::Size image_size,
                                                         const std::string& file) {
  CameraDescription description;
  description.camera = camera;
  description.clock = {.clock_id = camera, .timebase = "recording"};
  description.sensor = SensorKind::kFrame;
  description.image_size_px = {static_cast<uint32_t>(image_size.width),
                               static_cast<uint32_t>(image_size.height)};
  if (calibration_path.empty()) return description;
  absl::StatusOr<IntrinsicsFile> calibration = ReadIntrinsicsFile(calibration_path);
  if (!calibration.ok()) {
    return absl::Status(
        calibration.status().code(),
        absl::StrCat("camera ", camera, ": ", std::string(calibration.status().message()),
                     "; name the camera's OpenCV YAML with ;calibration=FILE, or say "
                     ";calibration=none for a camera without one"));
  }
  const ImageSize& size = calibration->image_size_px;
  if (size != description.image_size_px) {
    return absl::InvalidArgumentError(absl::StrCat(
        "camera ", camera, ": ", file, " is ", image_size.width, "x", image_size.height,
        " pixels, but the calibration ", calibration_path, " is one for ", size.width, "x",
        size.height, "; calibrate the camera at this size or name the right file"));
  }
  description.intrinsics = std::move(calibration->intrinsics);
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

absl::Status RecordedFrameSource::Describe(std::string_view kind, cv::Size image_size,
                                           const std::string& file) {
  RIGCAL_ASSIGN_OR_RETURN(
      description_,
      DescribeRecordedCamera(options_.camera, options_.calibration_path, image_size, file));
  if (options_.exposure_s > 0) description_.settings.emplace().exposure_s = options_.exposure_s;
  description_.source = absl::StrCat(std::string(kind), ":",
                                     std::filesystem::path(options_.path).filename().string());
  return description_.Validate();
}

void RecordedFrameSource::BeginCapture() {
  counts_ = {};
  pacer_.Start();
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

Frame RecordedFrameSource::MakeFrame(int64_t time_ns, uint32_t clock_epoch) {
  ++counts_.received;
  return {.image = ViewOf(image_),
          .time_ns = time_ns,
          .clock_epoch = clock_epoch,
          .exposure_s = options_.exposure_s};
}

void RecordedFrameSource::Refuse(RefusalReason reason, const std::string& what) {
  spdlog::debug("camera {}: {}: {}", options_.camera, NameOf(reason), what);
  refused_.Add("", reason, 1, what);
  ++counts_.damaged;
}

}  // namespace rigcal::agent
