// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/paced_source.h"
#include "agent/capture/recorded/frame_times.h"
#include "agent/capture/recorded/recording_options.h"

namespace rigcal::agent {

struct RecordedFramesOptions;
void AddOptions(RecordedFramesOptions* options, OptionTable* table);

// Recorded frames: a folder of images, or a video.
struct RecordedFramesOptions : RecordingOptions {
  std::string timestamps_path;  // times of the frames, see the source; empty: where it looks
  double fps = 0;               // frame i is at i / fps; 0: the recording has times
  double exposure_s = 0;        // of every frame; 0: not known
  StampMoment stamps = StampMoment::kMiddle;
  int bits = 16;  // that the camera has, of pixels with room for 16

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

// As DescribeRecording, for frames of `image_size`. INVALID_ARGUMENT: the calibration is for
// another size; `file` names the image that was read.
absl::StatusOr<CameraDescription> DescribeRecordedFrames(const std::string& kind,
                                                         const RecordedFramesOptions& options,
                                                         cv::Size image_size,
                                                         const std::string& file);

// What sources of recorded frames share. Frames are refused one by one, counted and passed over.
class RecordedFrameSource : public PacedSource<FrameSource, RecordedFramesOptions> {
 public:
  FrameCounts counts() const override { return counts_; }
  std::vector<Refusal> Refused() const override { return refused_.List(); }

 protected:
  explicit RecordedFrameSource(RecordedFramesOptions options)
      : PacedSource(std::move(options), {}) {}

  // The file of times: the one of the options, or `usual` if it exists. Its faults are counted.
  // Empty: there is none.
  absl::StatusOr<FrameTimes> ReadTimes(const std::string& usual);
  // Whether the image is as large as the camera's; else it is refused.
  bool HasRightSize(const cv::Mat& image, const std::string& name);
  // Of `image_`.
  Frame MakeFrame(int64_t time_ns, uint32_t clock_epoch, const std::string& file = "");
  void Refuse(RefusalReason reason, const std::string& what);
  std::string prefix() const { return "camera " + options_.camera + ": "; }

  cv::Mat image_;  // of the last frame
  FrameCounts counts_;
  RefusalCounter refused_;
};

}  // namespace rigcal::agent
