// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/wand_detector.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/detect/blobs/blob_contrast.h"
#include "agent/detect/blobs/blob_splitter.h"
#include "agent/detect/frame/image_exposure.h"
#include "agent/detect/frame/wand_track.h"
#include "agent/identify/wand_verifier.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Errors besides noise: sampling, the clipped coverage, the lens between calibration points.
constexpr double kModelSigmaPx = 0.006;
constexpr int kNeverWashedOut = 256;              // ColourRange::washed_out_min
constexpr double kLevels[] = {0, 0.2, 0.4, 0.6};  // from value_min to the brightest
constexpr double kCrowded = 0.06;                 // of the image
constexpr int kLargeAreaPx = 800;
constexpr int kPart = 4;  // a piece that much smaller is something in front of the other

// A blob that a window inside the image may have cut.
bool TouchesEdge(const PixelRect& box, const PixelRect& window, const PixelRect& bounds) {
  return (box.x <= window.x && window.x > bounds.x) || (box.y <= window.y && window.y > bounds.y) ||
         (box.x + box.width >= window.x + window.width &&
          window.x + window.width < bounds.x + bounds.width) ||
         (box.y + box.height >= window.y + window.height &&
          window.y + window.height < bounds.y + bounds.height);
}

}  // namespace

absl::Status WandDetectorOptions::Validate() const {
  FaultList faults;
  faults.Add(BlobFinderOptions::Validate());
  faults.CheckRange("max_blobs", max_blobs, 2, 4096);
  WandLimits::Check(&faults);
  faults.CheckRange("exposure", exposure_s, 0, 10);
  return faults.Result("wand detector: ");
}

WandDetector::WandDetector(const WandDetectorOptions& options, const Target& target,
                           const CameraDescription& camera)
    : options_(options),
      target_(target),
      camera_(camera),
      wand_finder_({.limits = options}, target, camera),
      verifier_(options.min_confidence),
      light_sigma_s_(LightTimeSigma(options.exposure_s, target)) {}

// More passes than a wand and some things of its colour.
bool WandDetector::IsCrowded() const {
  const double pixels = static_cast<double>(camera_.image_size_px.width) *
                        static_cast<double>(camera_.image_size_px.height);
  return result().over_limit > 0 || static_cast<double>(result().passed_px) > kCrowded * pixels;
}

Verdict WandDetector::SearchAll(const ImageView& image) {
  Verdict verdict;
  for (size_t level = 0; level < levels_.size(); ++level) {
    verdict = Search(image, image.Bounds(), level);
    if (verdict.wand || !IsCrowded()) break;
  }
  return verdict;
}

Verdict WandDetector::Search(const ImageView& image, const PixelRect& part, size_t level) {
  window_ = part;
  level_ = level;
  const BlobResult& found = levels_[level].blobs.Find(image, part);
  standing_out_.clear();
  cut_.clear();
  const auto keep = [&](const Blob& blob, bool is_cut) {
    if (!StandsOut(image, blob)) return;
    // The box of one blob may hold a part of another's pieces.
    for (size_t i = 0; i < standing_out_.size(); ++i) {
      Blob& known = standing_out_[i];
      const double squared_px2 = (known.centre_px - blob.centre_px).squaredNorm();
      if (squared_px2 * std::numbers::pi >= std::max(known.area_px, blob.area_px)) continue;
      if (kPart * std::min(known.area_px, blob.area_px) < std::max(known.area_px, blob.area_px)) {
        continue;  // not the same thing
      }
      if (blob.area_px <= known.area_px) return;
      known = blob;
      cut_[i] = is_cut;
      return;
    }
    standing_out_.push_back(blob);
    cut_.push_back(is_cut);
  };
  for (const Blob& blob : found.blobs) {
    const bool is_cut = TouchesEdge(blob.box, part, image.Bounds());
    const bool round = IsRound(blob);
    if (round) keep(blob, is_cut);
    // Of a large round one a marker may be a part: a sphere in front of a warm lampshade.
    if (round && blob.area_px < kLargeAreaPx) continue;
    // A sphere in front of a window or a lamp has merged with its white.
    for (const Blob& coloured : levels_[level].coloured.Find(image, blob.box).blobs) {
      if (coloured.area_px < blob.area_px && IsRound(coloured)) keep(coloured, is_cut);
    }
    for (const Blob& piece : splitter_.Split(image, blob, options_.min_area_px)) {
      keep(piece, is_cut);
    }
  }
  return verifier_.Verify(image, standing_out_, wand_finder_, wand_finder_.Find(standing_out_));
}

std::optional<VerifiedWand> WandDetector::SearchTracked(const ImageView& image, int64_t time_ns,
                                                        uint32_t clock_epoch) {
  const auto part = track_.Window(time_ns, clock_epoch, image.Bounds());
  if (!part.has_value()) return std::nullopt;
  const Verdict verdict = Search(image, *part, level_);
  if (!verdict.wand.has_value() || verdict.wand->OccludedCount() > 0) return std::nullopt;
  for (const int blob : verdict.wand->blobs) {
    if (cut_[static_cast<size_t>(blob)]) return std::nullopt;
  }
  return verdict.wand;
}

MarkerObservation WandDetector::Observe(const VerifiedWand& wand, size_t k) const {
  MarkerObservation marker;
  marker.label_confidence = static_cast<float>(wand.label_confidence);
  if (!wand.whole[k]) return marker;
  const MarkerCentre& centre = wand.centres[k];
  marker.visible = true;
  marker.centre_px = centre.centre_px;
  marker.covariance_px2 =
      centre.covariance_px2 + kModelSigmaPx * kModelSigmaPx * Eigen::Matrix2d::Identity();
  if (const auto velocity = track_.Velocity(k); velocity.has_value()) {
    const Eigen::Vector2d spread_px = light_sigma_s_ * *velocity;
    marker.covariance_px2 += spread_px * spread_px.transpose();
  }
  wand_finder_.ToSphereCentre(wand.fit, k, &marker);
  return marker;
}

void WandDetector::Follow(const VerifiedWand& wand, Detection* detection) {
  Observation& observation = detection->observation;
  detection->confidence = wand.confidence;
  detection->occluded_markers = wand.OccludedCount();
  WandTrack::Points centres;
  double radius_px = 0;
  for (const MarkerCentre& centre : wand.centres) {
    centres.push_back(centre.centre_px);
    radius_px = std::max(radius_px, centre.radius_px);
  }
  track_.Add(observation.time_ns, observation.clock_epoch, centres, radius_px);
  for (size_t k = 0; k < wand.blobs.size(); ++k) observation.markers[k] = Observe(wand, k);
}

DetectionOutcome WandDetector::WhyNone(const ImageView& image, const Verdict& verdict) const {
  const ImageExposure exposure = LookAtExposure(image);
  if (exposure == ImageExposure::kSaturated) return DetectionOutcome::kSaturated;
  if (verdict.ambiguous) return DetectionOutcome::kAmbiguous;
  if (result().over_limit > 0) return DetectionOutcome::kTooManyBlobs;
  if (!result().blobs.empty()) return DetectionOutcome::kNoWand;
  return exposure == ImageExposure::kBlack ? DetectionOutcome::kBlack : DetectionOutcome::kNoBlob;
}

absl::StatusOr<WandDetector> WandDetector::Create(const WandDetectorOptions& options,
                                                  const Target& target,
                                                  const CameraDescription& camera) {
  absl::Status status = options.Validate();
  status.Update(CheckTargetAndCamera(target, camera));
  if (!status.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", camera.camera, ": ", std::string(status.message())));
  }
  WandDetector detector(options, target, camera);
  for (const double share : kLevels) {
    BlobFinderOptions its = options;
    its.colour.value_min += static_cast<int>(share * (255 - its.colour.value_min));
    RIGCAL_ASSIGN_OR_RETURN(BlobFinder blobs, BlobFinder::Create(its));
    its.colour.washed_out_min = kNeverWashedOut;
    RIGCAL_ASSIGN_OR_RETURN(BlobFinder coloured, BlobFinder::Create(its));
    detector.levels_.push_back({std::move(blobs), std::move(coloured)});
  }
  return detector;
}

absl::StatusOr<Detection> WandDetector::Detect(const ImageView& image, int64_t time_ns,
                                               uint32_t clock_epoch) {
  const ImageSize size = camera_.image_size_px;
  if (image.data == nullptr || image.width != static_cast<int>(size.width) ||
      image.height != static_cast<int>(size.height)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "camera ", camera_.camera, ": an image of ", image.width, "x", image.height, " pixels",
        image.data == nullptr ? " without data" : "", ", its description says ", size.width, "x",
        size.height, "; set the camera's region or its calibration right"));
  }
  Detection detection;
  detection.observation.time_ns = time_ns;
  detection.observation.clock_epoch = clock_epoch;
  detection.observation.markers.resize(static_cast<size_t>(target_.marker_count()));

  std::optional<VerifiedWand> wand;
  if (options_.tracking) wand = SearchTracked(image, time_ns, clock_epoch);
  detection.tracked = wand.has_value();
  detection.outcome = DetectionOutcome::kWand;
  if (!wand.has_value()) {
    const Verdict verdict = SearchAll(image);
    wand = verdict.wand;
    if (!wand.has_value()) detection.outcome = WhyNone(image, verdict);
  }
  detection.blob_count = static_cast<int>(result().blobs.size());
  if (wand.has_value()) {
    Follow(*wand, &detection);
  } else {
    track_.Forget();
  }
  return detection;
}

}  // namespace rigcal::agent
