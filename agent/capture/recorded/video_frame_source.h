// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/recorded/recorded_frame_source.h"

namespace rigcal::agent {

// The frames of a video that OpenCV's FFmpeg or GStreamer can read (mkv, avi, mp4, ...), in order.
// Times are those of `timestamps_path` (a line timestamp_ns for each frame), else of
// STEM.timestamps.csv beside the video, else fps, else the file's own. Refused: frame_no_time (no
// time, or none after the previous one), frame_wrong_size. Frames that a truncated file lacks are
// counted as video_truncated and lost.
class VideoFrameSource : public RecordedFrameSource {
 public:
  // NOT_FOUND: no such file. FAILED_PRECONDITION: it cannot be read as a video, or has no frame.
  // INVALID_ARGUMENT: it has no times, or the calibration does not fit. Each names the camera, the
  // file and what to do.
  static absl::StatusOr<std::unique_ptr<VideoFrameSource>> Create(RecordedFramesOptions options);

  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Frame>> Next() override;

 private:
  using RecordedFrameSource::RecordedFrameSource;
  absl::Status DescribeCamera();
  absl::Status Open();
  absl::StatusOr<bool> Read();
  std::optional<int64_t> TimeOfFrame() const;  // of the one read last
  void NoteEnd();

  cv::VideoCapture video_;
  std::vector<std::optional<int64_t>> given_times_ns_;
  uint64_t read_ = 0;  // frames
  std::optional<int64_t> last_ns_;
  cv::Mat decoded_;
};

}  // namespace rigcal::agent
