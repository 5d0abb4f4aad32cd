// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "agent/capture/detector_control.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/light_code_reader.h"
#include "agent/capture/observation_source.h"
#include "agent/capture/preview/preview_tap.h"
#include "agent/capture/static_mask.h"
#include "agent/detect/frame/background_learner.h"
#include "agent/detect/frame/colour_share.h"
#include "agent/detect/frame/wand_detector.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

// How the wand is found in a camera's frames.
struct DetectingOptions {
  WandDetectorOptions detector;
  // An image of the camera's size, white where pixels are ignored, as `rigcal-agent mask` writes
  // it; empty: none.
  std::string mask_path;
  // At the start of each capture (camera time) static bright spots are learnt and added
  // to the mask. Observations of that time are empty.
  double learn_mask_s = 0;
  // Spots of the wand's colour that have stayed where they are for so long are ignored until they
  // change, throughout the capture; 0: never. A wand that rests is, after three times as long.
  double background_s = 3;
};

// Observations of a camera that yields frames: one per frame, empty if the wand is not found.
// Refused counts faults of the frames (frame_black, frame_saturated, too_many_blobs) and
// marker_occluded for each sphere that is half occluded; they are logged from time to time, as is
// an exposure shorter than one blink of the target.
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
  std::vector<ClockSample> TakeClockSamples() override;
  std::vector<Refusal> Refused() const override;
  std::optional<FrameCounts> frame_counts() const override { return frames_->counts(); }
  std::optional<DetectionCounts> detection_counts() const override { return detections_; }
  PreviewTap* preview_tap() override { return &preview_tap_; }
  DetectorControl* detector_control() override { return &control_; }

  // Of the last observation.
  const Detection& last_detection() const { return detection_; }
  // Frames of this capture in which a wand was ignored because it rests.
  uint64_t resting_wands() const { return resting_wands_; }
  // Of this capture so far.
  const ExposureFacts& exposure_facts() const { return exposure_facts_; }
  // The region searched and the blobs found in it; empty before the first frame.
  PixelRect last_window() const { return detector_ ? detector_->window() : PixelRect{}; }
  absl::Span<const Blob> last_blobs() const {
    return detector_ ? detector_->blobs() : absl::Span<const Blob>();
  }

 private:
  DetectingObservationSource(std::unique_ptr<FrameSource> frames, DetectingOptions options,
                             PixelMask mask)
      : frames_(std::move(frames)),
        options_(std::move(options)),
        control_(frames_->description(), options_.detector.colour, std::move(mask)) {}
  // A detector as the control says.
  absl::Status MakeDetector();
  bool LearnsMask(const Frame& frame);
  void NoteBackground(const Frame& frame);
  void CheckExposure(const Frame& frame);
  // What the frame shows instead of the target, for people.
  std::string OtherTarget() const;
  void CheckTarget();
  void CheckInterlacing();
  void Note(const Frame& frame);
  void Warn(RefusalReason reason, const std::string& what);

  const std::unique_ptr<FrameSource> frames_;
  const DetectingOptions options_;
  DetectorControl control_;
  PreviewTap preview_tap_;
  std::unique_ptr<FrameDetector> detector_;
  Target target_;
  PixelMask start_mask_;  // learnt at the start of this capture; without pixels: none
  std::optional<StaticMaskLearner> learner_;
  std::optional<BackgroundLearner> background_;
  uint64_t resting_wands_ = 0;
  double reported_background_ = 0;  // share
  ExposureFacts exposure_facts_;
  std::optional<int64_t> learn_until_ns_;
  bool exposure_checked_ = false;
  LightCodeReader light_code_;
  int other_target_frames_ = 0, interlaced_frames_ = 0;  // that show another wand than the target
  Detection detection_;
  DetectionCounts detections_;
  RefusalCounter refused_;
  std::map<RefusalReason, std::chrono::steady_clock::time_point> warned_;
};

}  // namespace rigcal::agent
