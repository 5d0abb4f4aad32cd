// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/wand_detector.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/detect/frame/image_exposure.h"
#include "agent/detect/frame/interlacing.h"
#include "agent/detect/frame/other_spacing.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// One sigma of errors besides noise: sampling, clipped coverage, the lens between known points.
constexpr double kModelSigmaPx = 0.003;

// Speed of a wand that is not followed yet, as hands move: m/s, one sigma along each axis.
constexpr double kHandSpeed = 0.6;

// Of a channel in the middle of a sphere: darker says little, brighter may be clipped.
constexpr double kUnreadGrey = 25, kFullGrey = 250;

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
                           const CameraDescription& camera, SpotFinder spot_finder)
    : options_(options),
      target_(target),
      camera_(camera),
      search_(options, options.colour.washed_out_min, options.without, target, camera,
              std::move(spot_finder)),
      short_light_sigma_s_(ShortLightTimeSigma(options.exposure_s, target)),
      light_sigma_s_(std::max(short_light_sigma_s_, LightTimeSigma(options.exposure_s, target))) {}

std::optional<VerifiedWand> WandDetector::SearchTracked(const ImageView& image, int64_t time_ns,
                                                        uint32_t clock_epoch) {
  const auto part = track_.Window(time_ns, clock_epoch, image.Bounds());
  return part ? search_.SearchPart(image, *part) : std::nullopt;
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
  } else if (k < wand.px_per_m.size()) {
    const double spread_px = short_light_sigma_s_ * kHandSpeed * wand.px_per_m[k];
    marker.covariance_px2 += spread_px * spread_px * Eigen::Matrix2d::Identity();
  }
  search_.wand_finder().ToSphereCentre(wand.fit, k, &marker);
  return marker;
}

std::optional<double> WandDetector::LightLevel(const VerifiedWand& wand) {
  const size_t count = wand.centres.size(), middle = count / 2;
  if (!wand.whole[middle]) return std::nullopt;
  Eigen::Vector3d others_grey = Eigen::Vector3d::Zero();
  int others = 0;
  for (const size_t k : {middle - 1, middle + 1}) {
    if (k >= count || !wand.whole[k]) continue;
    others_grey += wand.centres[k].plateau_grey;
    ++others;
  }
  Eigen::Vector3d middle_grey = wand.centres[middle].plateau_grey;
  if (others > 0) {
    others_grey /= others;
  } else {
    others_grey = middle_grey;
  }
  // The brightest channel that is not clipped.
  int best = -1;
  for (int channel = 0; channel < 3; ++channel) {
    const double grey = std::max(others_grey[channel], middle_grey[channel]);
    if (grey < kUnreadGrey || grey > kFullGrey || middle_grey[channel] <= 0) continue;
    if (best < 0 || others_grey[channel] > others_grey[best]) best = channel;
  }
  if (best < 0) return std::nullopt;
  const double level = std::log(middle_grey[best]);
  return others > 0 ? level - std::log(others_grey[best]) : level;
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
    detection->marker_grey = std::max(detection->marker_grey, centre.plateau_grey.maxCoeff());
  }
  detection->marker_radius_px = radius_px;
  detection->light_level = LightLevel(wand);
  track_.Add(observation.time_ns, observation.clock_epoch, centres, radius_px);
  for (size_t k = 0; k < wand.blobs.size(); ++k) observation.markers[k] = Observe(wand, k);
}

DetectionOutcome WandDetector::WhyNone(const ImageView& image, const Verdict& verdict) const {
  const ImageExposure exposure = LookAtExposure(image);
  if (exposure == ImageExposure::kSaturated) return DetectionOutcome::kSaturated;
  if (verdict.ambiguous) return DetectionOutcome::kAmbiguous;
  if (search_.result().over_limit > 0 || search_.cut_short())
    return DetectionOutcome::kTooManyBlobs;
  if (!search_.result().blobs.empty()) return DetectionOutcome::kNoWand;
  return exposure == ImageExposure::kBlack ? DetectionOutcome::kBlack : DetectionOutcome::kNoBlob;
}

absl::StatusOr<WandDetector> WandDetector::Create(const WandDetectorOptions& options,
                                                  const Target& target,
                                                  const CameraDescription& camera) {
  absl::Status status = CheckIsLine(target);
  status.Update(options.Validate());
  status.Update(CheckTargetAndCamera(target, camera));
  if (!status.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", camera.camera, ": ", std::string(status.message())));
  }
  RIGCAL_ASSIGN_OR_RETURN(SpotFinder spot_finder, SpotFinder::Create(options));
  return WandDetector(options, target, camera, std::move(spot_finder));
}

absl::StatusOr<Detection> WandDetector::Detect(const ImageView& image, int64_t time_ns,
                                               uint32_t clock_epoch) {
  RIGCAL_RETURN_IF_ERROR(CheckImage(camera_, image));
  Detection detection;
  detection.observation.time_ns = time_ns;
  detection.observation.clock_epoch = clock_epoch;
  detection.observation.markers.resize(static_cast<size_t>(target_.marker_count()));

  search_.StartImage();
  std::optional<VerifiedWand> wand;
  if (options_.tracking) wand = SearchTracked(image, time_ns, clock_epoch);
  detection.tracked = wand.has_value();
  detection.outcome = DetectionOutcome::kWand;
  if (!wand.has_value()) {
    const Verdict verdict = search_.SearchAll(image);
    wand = verdict.wand;
    if (!wand.has_value()) detection.outcome = WhyNone(image, verdict);
  }
  detection.cut_short = search_.cut_short();
  detection.passed_share = search_.passed_share();
  detection.white_share = search_.white_share();
  detection.dismissed_patches = search_.dismissed();
  detection.blob_count = static_cast<int>(search_.result().blobs.size());
  detection.looks_interlaced = LooksInterlaced(image, search_.result().blobs);
  if (wand.has_value()) {
    Follow(*wand, &detection);
  } else {
    track_.Forget();
    const OtherWand other = FindOtherWand(search_.spot_finder().spots(), search_.wand_finder());
    detection.other_middle_share = other.middle_share;
    detection.other_size_ratio = other.size_ratio;
  }
  return detection;
}

absl::StatusOr<WandExplanation> WandDetector::Explain(const ImageView& image) {
  WandExplanation explanation;
  track_.Forget();
  search_.Record(&explanation.trials);
  absl::StatusOr<Detection> detection = Detect(image, 0, 0);
  search_.Record(nullptr);
  track_.Forget();
  if (!detection.ok()) return detection.status();
  explanation.detection = *std::move(detection);
  std::ranges::stable_sort(explanation.trials, [](const WandTrial& a, const WandTrial& b) {
    if (a.refusal.empty() != b.refusal.empty()) return a.refusal.empty();
    return a.wand.log_odds > b.wand.log_odds;
  });
  // The same spots may be found at several levels of colour.
  const auto repeated =
      std::ranges::unique(explanation.trials, [](const WandTrial& a, const WandTrial& b) {
        return a.refusal.empty() && b.refusal.empty() && a.wand.log_odds == b.wand.log_odds &&
               SamePlaces(a.wand, b.wand);
      });
  explanation.trials.erase(repeated.begin(), repeated.end());
  return explanation;
}

}  // namespace rigcal::agent
