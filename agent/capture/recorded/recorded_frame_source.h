// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/pacer.h"
#include "agent/capture/recorded/frame_times.h"
#include "common/camera/camera_description.h"
#include "common/options/option_table.h"

namespace rigcal::agent {

// Recorded frames: a folder of images, or a video.
struct RecordedFramesOptions {
  std::string camera;            // name within the rig
  std::string path;              // of the folder, the image or the video
  std::string calibration_path;  // OpenCV YAML with intrinsics and image size; empty: none
  std::string timestamps_path;   // times of the frames, see the source; empty: where it looks
  double fps = 0;                // frame i is at i / fps; 0: the recording has times
  double exposure_s = 0;         // of every frame; 0: not known
  double speed = 1;              // multiple of the recorded pace, > 0; kMaxSpeed: no waiting

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

void AddOptions(RecordedFramesOptions* options, OptionTable* table);

// How a camera of recorded frames is described: its own clock, time base "recording".
// `calibration_path` empty: no intrinsics. INVALID_ARGUMENT: the calibration cannot be read, or is
// for another size than `image_size`; `file` names the image that was read.
absl::StatusOr<CameraDescription> DescribeRecordedCamera(const std::string& camera,
                                                         const std::string& calibration_path,
                                                         cv::Size image_size,
                                                         const std::string& file);

// What sources of recorded frames share. Frames are refused one by one, counted and passed over.
class RecordedFrameSource : public FrameSource {
 public:
  const CameraDescription& description() const override { return description_; }
  void Stop() override { pacer_.Stop(); }
  FrameCounts counts() const override { return counts_; }
  std::vector<Refusal> Refused() const override { return refused_.List(); }

 protected:
  explicit RecordedFrameSource(RecordedFramesOptions options)
      : options_(std::move(options)), pacer_(options_.speed) {}

  // The file of times: the one of the options, or `usual` if it exists. Its faults are counted.
  // Empty: there is none.
  absl::StatusOr<FrameTimes> ReadTimes(const std::string& usual);
  // `kind`: "images".
  absl::Status Describe(std::string_view kind, cv::Size image_size, const std::string& file);
  void BeginCapture();
  // Whether the image is as large as the camera's; else it is refused.
  bool HasRightSize(const cv::Mat& image, const std::string& name);
  // Of `image_`.
  Frame MakeFrame(int64_t time_ns, uint32_t clock_epoch);
  void Refuse(RefusalReason reason, const std::string& what);
  std::string prefix() const { return "camera " + options_.camera + ": "; }

  const RecordedFramesOptions options_;
  CameraDescription description_;
  Pacer pacer_;
  cv::Mat image_;  // of the last frame
  FrameCounts counts_;
  RefusalCounter refused_;
};

}  // namespace rigcal::agent
