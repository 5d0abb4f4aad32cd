// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/learning/learning_task.h"

#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/capture/static_mask.h"
#include "agent/detect/frame/colour_tuning.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr double kLargestMaskShare = 0.5;
// In fewer frames something else may have looked like the wand.
constexpr int kFewestHiddenWands = 3;

class MaskTask : public LearningTask {
 public:
  explicit MaskTask(StaticMaskLearner learner) : learner_(std::move(learner)) {}

  absl::Status Add(const PreviewFrame& frame) override {
    learner_.Add(frame.image);
    if (frame.detection.outcome == DetectionOutcome::kWand) {
      wands_.push_back(frame.detection.observation);
    }
    return absl::OkStatus();
  }

  absl::StatusOr<std::string> Finish(DetectorControl* detector) override {
    PixelMask mask = learner_.Learn();
    int hidden = 0;
    for (const Observation& wand : wands_) hidden += Hides(mask, wand) ? 1 : 0;
    if (hidden >= kFewestHiddenWands) {
      return absl::FailedPreconditionError(
          absl::StrCat("the wand was in view in ", wands_.size(), " of ", learner_.frame_count(),
                       " frames, and the mask would hide it; take it out of view, or keep it "
                       "moving, and learn again. Lamps that stand like the wand are masked on the "
                       "agent's PC: rigcal-agent mask"));
    }
    const int64_t pixels = mask.CountPixels();
    const double share = static_cast<double>(pixels) / (1.0 * mask.width() * mask.height());
    if (share > kLargestMaskShare) {
      return absl::FailedPreconditionError(absl::StrFormat(
          "the mask would hide %.0f %% of the image: the colour range contains too much of it; "
          "tune the detector first, or shorten the exposure",
          100 * share));
    }
    std::string text =
        absl::StrFormat("learnt from %d frames to ignore %d pixels (%.3g %%)",
                        learner_.frame_count(), static_cast<int>(pixels), 100 * share);
    detector->SetMask(std::move(mask));
    return text;
  }

 private:
  static bool Hides(const PixelMask& mask, const Observation& wand) {
    for (const MarkerObservation& marker : wand.markers) {
      if (marker.visible && mask.Get(static_cast<int>(std::lround(marker.centre_px.x())),
                                     static_cast<int>(std::lround(marker.centre_px.y())))) {
        return true;
      }
    }
    return false;
  }

  StaticMaskLearner learner_;
  std::vector<Observation> wands_;
};

class ColourTask : public LearningTask {
 public:
  explicit ColourTask(ColourTuner tuner) : tuner_(std::move(tuner)) {}

  absl::Status Add(const PreviewFrame& frame) override { return tuner_.Add(frame.image); }

  absl::StatusOr<std::string> Finish(DetectorControl* detector) override {
    RIGCAL_ASSIGN_OR_RETURN(const TunedColour tuned, tuner_.Result());
    detector->SetColour(tuned.colour);
    return absl::StrFormat(
        "the wand was found in %d of %d frames; median colour: hue %.0f deg, saturation %.2f, "
        "value %.0f",
        tuned.wands, tuned.frames, tuned.hue_deg, tuned.saturation, tuned.value);
  }

 private:
  ColourTuner tuner_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<LearningTask>> MakeMaskTask(const DetectorControl& detector) {
  RIGCAL_ASSIGN_OR_RETURN(
      StaticMaskLearner learner,
      StaticMaskLearner::Create(detector.colour(), detector.camera().image_size_px));
  return std::make_unique<MaskTask>(std::move(learner));
}

absl::StatusOr<std::unique_ptr<LearningTask>> MakeColourTask(const DetectorControl& detector,
                                                             const Target& target) {
  absl::StatusOr<ColourTuner> tuner = ColourTuner::Create(target, detector.camera());
  if (!tuner.ok()) {
    return absl::FailedPreconditionError(std::string(tuner.status().message()));
  }
  return std::make_unique<ColourTask>(*std::move(tuner));
}

}  // namespace rigcal::agent
