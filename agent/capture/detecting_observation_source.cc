// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/detecting_observation_source.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/capture/camera_status.h"
#include "agent/detect/frame/colour_share.h"
#include "agent/detect/frame/other_spacing.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr std::chrono::seconds kWarnInterval{10};
constexpr int kFramesOfOtherTarget = 20, kInterlacedFrames = 20;  // before it is said
// Of the image: background that is worth a line in the log, and again when it has grown so much.
constexpr double kWorthALine = 1e-4, kGrown = 2;

// The longest one, which an exposure has to hold.
double BlinkPeriodS(const Target& target) {
  if (target.blink_hz.empty()) return 0;
  const double slowest_hz = *std::min_element(target.blink_hz.begin(), target.blink_hz.end());
  return slowest_hz > 0 ? 1 / slowest_hz : 0;
}

struct Advice {
  DetectionOutcome outcome;
  RefusalReason reason;
  std::string_view what;  // the beginning of it
};
constexpr Advice kAdvice[] = {
    {DetectionOutcome::kBlack, RefusalReason::kFrameBlack,
     "the frame is black: lens cap, short exposure, or no light"},
    {DetectionOutcome::kSaturated, RefusalReason::kFrameSaturated,
     "most of the frame is saturated: "},
    {DetectionOutcome::kTooManyBlobs, RefusalReason::kTooManyBlobs, ""},
};

}  // namespace

absl::StatusOr<std::unique_ptr<DetectingObservationSource>> DetectingObservationSource::Create(
    std::unique_ptr<FrameSource> frames, DetectingOptions options) {
  const CameraDescription& camera = frames->description();
  RIGCAL_RETURN_IF_ERROR(OfCamera(camera.camera, options.detector.Validate()));
  PixelMask mask;
  if (!options.mask_path.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(
        mask, OfCamera(camera.camera, ReadMask(options.mask_path, camera.image_size_px)));
  }
  return std::unique_ptr<DetectingObservationSource>(
      new DetectingObservationSource(std::move(frames), std::move(options), std::move(mask)));
}

absl::Status DetectingObservationSource::Start(const Target& target) {
  RIGCAL_RETURN_IF_ERROR(OfCamera(description().camera, CheckDetectable(target)));
  target_ = target;
  start_mask_ = {};
  RIGCAL_RETURN_IF_ERROR(MakeDetector());
  learner_.reset();
  learn_until_ns_.reset();
  if (options_.learn_mask_s > 0 && target_.IsLine()) {
    RIGCAL_ASSIGN_OR_RETURN(
        learner_, StaticMaskLearner::Create(control_.colour(), description().image_size_px));
  }
  resting_wands_ = 0;
  reported_background_ = 0;
  exposure_facts_ = {.blink_s = BlinkPeriodS(target)};
  exposure_checked_ = false;
  light_code_.Clear();
  other_target_frames_ = interlaced_frames_ = 0;
  detection_ = {};
  detections_ = {};
  refused_ = {};
  warned_.clear();
  RIGCAL_RETURN_IF_ERROR(frames_->Start(target));
  control_.SetTarget(target);
  return absl::OkStatus();
}

absl::Status DetectingObservationSource::MakeDetector() {
  const CameraDescription& camera = description();
  WandDetectorOptions options = options_.detector;
  options.colour = control_.colour();
  if (options.exposure_s <= 0 && camera.settings) options.exposure_s = camera.settings->exposure_s;
  RIGCAL_ASSIGN_OR_RETURN(detector_, MakeFrameDetector(options, target_, camera));
  detector_->SetIgnored(Union(start_mask_, control_.ignored()));
  // What was learnt of another colour is not all there is.
  background_.reset();
  if (options_.background_s > 0 && target_.IsLine()) {
    RIGCAL_ASSIGN_OR_RETURN(
        background_,
        BackgroundLearner::Create(options.colour, camera.image_size_px, options_.background_s));
    detector_->SetBackground(background_->background());
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<Observation>> DetectingObservationSource::Next() {
  const absl::StatusOr<std::optional<Frame>> next = frames_->Next();
  if (!next.ok() || !*next) {
    control_.SetTarget(std::nullopt);
    if (!next.ok()) return next.status();
    return std::nullopt;
  }
  const std::optional<Frame>& frame = *next;
  if (control_.TakeChange()) RIGCAL_RETURN_IF_ERROR(MakeDetector());
  CheckExposure(*frame);
  if (LearnsMask(*frame)) {
    Observation empty;
    empty.time_ns = frame->time_ns;
    empty.clock_epoch = frame->clock_epoch;
    empty.markers.resize(static_cast<size_t>(target_.marker_count()));
    return empty;
  }
  if (background_) background_->Look(frame->image);
  RIGCAL_ASSIGN_OR_RETURN(detection_,
                          detector_->Detect(frame->image, frame->time_ns, frame->clock_epoch));
  if (background_) {
    background_->Learn(frame->image, detection_);
    NoteBackground(*frame);
  }
  Note(*frame);
  light_code_.Look(description().camera, detection_);
  preview_tap_.Offer(frame->image, frame->time_ns, frame->clock_epoch, detection_,
                     detector_->window(), detector_->blobs());
  control_.frames().Offer(frame->image, frame->time_ns, frame->clock_epoch, detection_);
  return detection_.observation;
}

std::vector<ClockSample> DetectingObservationSource::TakeClockSamples() {
  std::vector<ClockSample> samples = frames_->TakeClockSamples();
  const std::vector<ClockSample> of_light = light_code_.Take();
  samples.insert(samples.end(), of_light.begin(), of_light.end());
  return samples;
}

bool DetectingObservationSource::LearnsMask(const Frame& frame) {
  if (!learner_) return false;
  if (!learn_until_ns_) {
    learn_until_ns_ = frame.time_ns + static_cast<int64_t>(options_.learn_mask_s * 1e9);
  }
  // A clock that jumps back ends the learning too.
  if (frame.time_ns < *learn_until_ns_ && frame.clock_epoch == 0) {
    learner_->Add(frame.image);
    return true;
  }
  start_mask_ = learner_->Learn();
  PixelMask ignored = Union(start_mask_, control_.ignored());
  spdlog::info("camera {}: learnt from {} frames to ignore {} pixels that do not move",
               description().camera, learner_->frame_count(), ignored.CountPixels());
  learner_.reset();
  detector_->SetIgnored(std::move(ignored));
  return false;
}

void DetectingObservationSource::NoteBackground(const Frame& frame) {
  detection_.background_share = background_->share();
  if (detection_.background_share > std::max(kWorthALine, kGrown * reported_background_)) {
    reported_background_ = detection_.background_share;
    spdlog::info(
        "camera {}: {:.3g} % of the picture has the wand's colour and has not changed for {:.3g} "
        "s; it is ignored until it does",
        description().camera, 100 * reported_background_, options_.background_s);
  }
  if (!background_->ignores_wand()) return;
  ++resting_wands_;
  const std::string what = absl::StrCat(
      "frame at ", frame.time_ns, " ns: what looks like the wand has rested for ",
      background_->rest_s(),
      " s and is ignored until it moves; if it is the wand, move it (background=0 keeps it)");
  refused_.Add("", RefusalReason::kWandResting, 1, what);
  Warn(RefusalReason::kWandResting, what);
}

void DetectingObservationSource::CheckExposure(const Frame& frame) {
  if (std::exchange(exposure_checked_, true)) return;
  const double blink_s = exposure_facts_.blink_s;
  if (frame.exposure_s <= 0 || blink_s <= 0 || frame.exposure_s >= blink_s) return;
  spdlog::warn(
      "camera {}: the exposure of {} ms is shorter than one blink of the target ({} ms): in some "
      "frames its markers are dark. Lengthen the exposure, or let the target blink faster",
      description().camera, frame.exposure_s * 1e3, blink_s * 1e3);
}

std::string DetectingObservationSource::OtherTarget() const {
  const std::string other_wand = OtherWandText(detection_, target_);
  return other_wand.empty() ? detection_.other_target : other_wand;
}

// Never where the target was seen, and not of single frames.
void DetectingObservationSource::CheckTarget() {
  const bool is_other = detection_.other_middle_share > 0 || detection_.other_size_ratio > 0 ||
                        !detection_.other_target.empty();
  if (detections_.Of(DetectionOutcome::kWand) > 0 || !is_other) return;
  if (++other_target_frames_ < kFramesOfOtherTarget) return;
  const std::string what = OtherTarget();
  const bool is_first = other_target_frames_ == kFramesOfOtherTarget;
  refused_.Add("", RefusalReason::kOtherTarget,
               is_first ? static_cast<uint64_t>(kFramesOfOtherTarget) : 1, what);
  if (is_first) spdlog::warn("camera {}: {}", description().camera, what);
}

// Once in a capture.
void DetectingObservationSource::CheckInterlacing() {
  if (!detection_.looks_interlaced || ++interlaced_frames_ != kInterlacedFrames) return;
  spdlog::warn(
      "camera {}: {} frames show what moves at two places, in odd and in even rows: the video "
      "is interlaced, and spheres are found between the two or not at all. Record progressive "
      "video, or make a frame of each field (ffmpeg: -vf bwdif=mode=send_field)",
      description().camera, interlaced_frames_);
}

void DetectingObservationSource::Note(const Frame& frame) {
  detections_.Add(detection_.outcome);
  CheckTarget();
  CheckInterlacing();
  const auto example = [&](std::string_view what) {
    return absl::StrCat("frame at ", frame.time_ns, " ns: ", std::string(what));
  };
  exposure_facts_.exposure_s = frame.exposure_s;
  if (detection_.marker_grey > 0) exposure_facts_.marker_grey = detection_.marker_grey;
  const std::string crowded =
      CrowdedText(detection_.passed_share, detection_.white_share, exposure_facts_);
  for (const Advice& advice : kAdvice) {
    if (detection_.outcome != advice.outcome) continue;
    std::string what = example(advice.what);
    if (advice.outcome == DetectionOutcome::kTooManyBlobs) {
      absl::StrAppend(
          &what, TooManyText(detection_.passed_share, detection_.white_share, exposure_facts_));
    } else if (advice.outcome == DetectionOutcome::kSaturated) {
      absl::StrAppend(&what, ShorterExposureText(exposure_facts_));
    }
    refused_.Add("", advice.reason, 1, what);
    Warn(advice.reason, what);
  }
  const bool is_missed = detection_.outcome == DetectionOutcome::kAmbiguous ||
                         detection_.outcome == DetectionOutcome::kNoWand ||
                         detection_.outcome == DetectionOutcome::kNoBlob;
  if (is_missed && !crowded.empty()) Warn(RefusalReason::kTooManyBlobs, example(crowded));
  if (detection_.occluded_markers > 0) {
    refused_.Add("", RefusalReason::kMarkerOccluded,
                 static_cast<uint32_t>(detection_.occluded_markers),
                 example("a sphere is half occluded"));
  }
}

void DetectingObservationSource::Warn(RefusalReason reason, const std::string& what) {
  const auto now = std::chrono::steady_clock::now();
  const auto last = warned_.find(reason);
  if (last != warned_.end() && now - last->second < kWarnInterval) return;
  warned_.insert_or_assign(reason, now);
  spdlog::warn("camera {}: {}", description().camera, what);
}

std::vector<Refusal> DetectingObservationSource::Refused() const {
  RefusalCounter all = refused_;
  for (const Refusal& refusal : frames_->Refused()) all.Add(refusal);
  light_code_.AddRefused(&all);
  return all.List();
}

}  // namespace rigcal::agent
