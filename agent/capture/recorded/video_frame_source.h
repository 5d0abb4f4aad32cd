// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/pacer.h"
#include "agent/capture/recorded/recorded_frames_options.h"

namespace rigcal::agent {

// `path`: what OpenCV's FFmpeg or GStreamer can read: mkv, avi, mp4, ... `timestamps_path`: a line
// `timestamp_ns` for each picture; empty: STEM.timestamps.csv beside the video if there is one,
// else the times of the file itself. `fps`: the file's times are not used.
struct VideoSourceOptions : RecordedFramesOptions {};

// The pictures of a video file, in order. Refused one by one, counted, and passed over:
// picture_no_time (no time, or none after that of the picture ahead: times of a file only grow),
// picture_wrong_size. What a truncated file lacks is counted as video_ends_early and lost.
class VideoFrameSource : public FrameSource {
 public:
  // NOT_FOUND: no such file. FAILED_PRECONDITION: it is no video that can be read, or has no
  // picture. INVALID_ARGUMENT: it has no times, or the calibration does not fit. Each names the
  // camera, the file and what to do.
  static absl::StatusOr<std::unique_ptr<VideoFrameSource>> Create(VideoSourceOptions options);

  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Frame>> Next() override;
  void Stop() override { pacer_.Stop(); }
  FrameCounts counts() const override { return counts_; }
  std::vector<Refusal> Refused() const override { return refused_.List(); }

 private:
  explicit VideoFrameSource(VideoSourceOptions options);
  absl::Status Describe();
  absl::Status Open();
  absl::StatusOr<bool> Read();
  std::optional<int64_t> TimeOfFrame() const;  // of the one read last
  void NoteEnd();
  void Refuse(std::string_view reason, const std::string& what);

  const VideoSourceOptions options_;
  CameraDescription description_;
  Pacer pacer_;
  cv::VideoCapture video_;
  std::vector<std::optional<int64_t>> given_times_ns_;
  uint64_t read_ = 0;  // pictures
  std::optional<int64_t> last_ns_;
  cv::Mat decoded_;
  cv::Mat picture_;  // what the frame yielded last shows
  FrameCounts counts_;
  RefusalCounter refused_;
};

}  // namespace rigcal::agent
