// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/recorded/recorded_frame_source.h"

namespace rigcal::agent {

// The images of a folder in the natural order of their names, or one image. Times are those of
// `timestamps_path` (lines name;timestamp_ns), else of the folder's timestamps.csv, else fps, else
// the numbers in the names (TimeFromName). Refused: frame_unreadable (truncated, damaged),
// frame_no_time, frame_wrong_size (another size than the intrinsics have). A time before the
// previous one begins a new clock epoch and is logged; equal times are passed on.
class ImagesFrameSource : public RecordedFrameSource {
 public:
  // NOT_FOUND: no such folder, or no image in it. INVALID_ARGUMENT: no image has a time, the times
  // are not nanoseconds, the calibration does not fit. FAILED_PRECONDITION: none of the first
  // images can be read. Each names the camera and what to do.
  static absl::StatusOr<std::unique_ptr<ImagesFrameSource>> Create(RecordedFramesOptions options);

  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Frame>> Next() override;

 private:
  struct TimedFrame {
    std::string path;
    std::optional<int64_t> time_ns;
  };

  using RecordedFrameSource::RecordedFrameSource;
  // Lists the folder again, with what is refused before an image is read.
  absl::Status List();
  absl::Status AssignTimes();
  absl::Status DescribeCamera();
  uint32_t ClockEpochOf(const TimedFrame& image);

  std::vector<TimedFrame> images_;
  size_t next_ = 0;
  ClockEpochCounter clock_epochs_;
  uint32_t clock_epoch_ = 0;
};

}  // namespace rigcal::agent
