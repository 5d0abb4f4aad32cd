// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/pacer.h"
#include "agent/capture/recorded/recorded_frames_options.h"

namespace rigcal::agent {

// `path`: a folder of pictures, or one picture. `timestamps_path`: `name;timestamp_ns` lines;
// empty: the folder's timestamps.csv if there is one, else the numbers in the names, see
// TimeFromName. `fps` is for pictures without such a file; 0: those without a time in their names
// are refused.
struct ImagesSourceOptions : RecordedFramesOptions {};

// Pictures of a folder in the natural order of their names. Refused one by one, counted, and passed
// over: picture_unreadable (truncated, damaged), picture_no_time, picture_wrong_size (not as large
// as the intrinsics are for). A time before the one ahead opens a new clock epoch and is logged;
// equal ones are passed on.
class ImagesFrameSource : public FrameSource {
 public:
  // NOT_FOUND: no such folder, or no picture in it. INVALID_ARGUMENT: no picture has a time, their
  // times are no nanoseconds, the calibration does not fit. FAILED_PRECONDITION: none of the first
  // pictures can be read. Each names the camera and what to do.
  static absl::StatusOr<std::unique_ptr<ImagesFrameSource>> Create(ImagesSourceOptions options);

  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Frame>> Next() override;
  void Stop() override { pacer_.Stop(); }
  FrameCounts counts() const override { return counts_; }
  std::vector<Refusal> Refused() const override { return refused_.List(); }

 private:
  struct TimedFrame {
    std::string path;
    std::optional<int64_t> time_ns;
  };

  explicit ImagesFrameSource(ImagesSourceOptions options);
  // Lists the folder anew, with what is refused before a picture is read.
  absl::Status List();
  absl::Status AssignTimes();
  absl::Status Describe();
  void Refuse(std::string_view reason, const std::string& what);
  uint32_t ClockEpochOf(const TimedFrame& picture);

  const ImagesSourceOptions options_;
  CameraDescription description_;
  Pacer pacer_;
  std::vector<TimedFrame> pictures_;
  size_t next_ = 0;
  cv::Mat picture_;  // what the frame yielded last shows
  ClockEpochCounter clock_epochs_;
  uint32_t clock_epoch_ = 0;
  FrameCounts counts_;
  RefusalCounter refused_;
};

}  // namespace rigcal::agent
