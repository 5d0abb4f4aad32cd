// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/observation_source.h"
#include "agent/capture/preview/preview_tap.h"
#include "agent/capture/static_mask.h"
#include "agent/detect/frame/wand_detector.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

// How the wand is found in a camera's pictures.
struct DetectingOptions {
  WandDetectorOptions detector;
  // A picture of the camera's size, white where nothing is looked for; empty: none. As written by
  // `rigcal-agent mask`.
  std::string mask_path;
  // At the beginning of each capture, for so long (camera time, 0 to 600 s), static bright spots
  // are learnt, on top of the mask's. The observations of that time are empty.
  double learn_mask_s = 0;

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

// A detector behind a camera that yields pictures: one observation per picture, empty where the
// wand is not found. Refuses nothing, but counts among the refused what the pictures are not good
// for: picture_black, picture_saturated, too_many_blobs, and marker_covered for each sphere that is
// half hidden. Warns of these now and then, and of an exposure shorter than one blink of the
// target.
class DetectingObservationSource : public ObservationSource {
 public:
  // INVALID_ARGUMENT: the options, or a mask that does not fit; NOT_FOUND: no such mask. Messages
  // begin with the camera's name.
  static absl::StatusOr<std::unique_ptr<DetectingObservationSource>> Create(
      std::unique_ptr<FrameSource> frames, DetectingOptions options);

  const CameraDescription& description() const override { return frames_->description(); }
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Observation>> Next() override;
  void Stop() override { frames_->Stop(); }
  std::vector<ClockSample> TakeClockSamples() override { return frames_->TakeClockSamples(); }
  std::vector<Refusal> Refused() const override;
  std::optional<FrameCounts> frame_counts() const override { return frames_->counts(); }
  std::optional<DetectionCounts> detection_counts() const override { return detections_; }
  PreviewTap* preview_tap() override { return &preview_tap_; }

  // What the picture gave whose observation was yielded last.
  const Detection& last_detection() const { return detection_; }
  // Where the detector looked and the blobs it saw there; empty before the first picture.
  PixelRect last_window() const { return detector_ ? detector_->window() : PixelRect{}; }
  absl::Span<const Blob> last_blobs() const {
    return detector_ ? detector_->blobs() : absl::Span<const Blob>();
  }

 private:
  DetectingObservationSource(std::unique_ptr<FrameSource> frames, DetectingOptions options,
                             PixelMask mask);
  absl::StatusOr<bool> LearnsMask(const Frame& frame);
  void CheckExposure(const Frame& frame);
  void Note(const Frame& frame);
  void Warn(std::string_view reason, const std::string& what);

  const std::unique_ptr<FrameSource> frames_;
  const DetectingOptions options_;
  const PixelMask mask_;  // without pixels: none
  PreviewTap preview_tap_;
  std::optional<WandDetector> detector_;
  std::optional<StaticMaskLearner> learner_;
  std::optional<int64_t> learn_until_ns_;
  int marker_count_ = 0;
  double blink_period_s_ = 0;  // 0: not known
  bool exposure_checked_ = false;
  Detection detection_;
  DetectionCounts detections_;
  RefusalCounter refused_;
  std::map<std::string, std::chrono::steady_clock::time_point, std::less<>> warned_;
};

}  // namespace rigcal::agent
