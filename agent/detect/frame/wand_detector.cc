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

namespace rigcal::agent {
namespace {

// Errors besides noise: sampling, the clipped coverage, the lens between calibration points.
constexpr double kModelSigmaPx = 0.006;
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

struct WandDetector::Impl {
  Impl(const WandDetectorOptions& options_in, const Target& target_in,
       const CameraDescription& camera_in, BlobFinder blob_finder_in)
      : options(options_in),
        target(target_in),
        camera(camera_in),
        blob_finder(std::move(blob_finder_in)),
        wand_finder({.limits = options_in}, target_in, camera_in),
        verifier(options_in.min_confidence),
        light_sigma_s(LightTimeSigma(options_in.exposure_s, target_in)) {}

  Verdict Search(const ImageView& image, const PixelRect& part);
  std::optional<VerifiedWand> SearchTracked(const ImageView& image, int64_t time_ns,
                                            uint32_t clock_epoch);
  MarkerObservation Observe(const VerifiedWand& wand, size_t marker) const;
  void Follow(const VerifiedWand& wand, Detection* detection);
  DetectionOutcome WhyNone(const ImageView& image, const Verdict& verdict) const;

  const WandDetectorOptions options;
  const Target target;
  const CameraDescription camera;
  BlobFinder blob_finder;
  WandFinder wand_finder;
  WandVerifier verifier;
  const double light_sigma_s;
  WandTrack track;
  PixelRect window;
  const BlobResult* blobs = nullptr;
  BlobSplitter splitter;
  std::vector<Blob> standing_out;  // of them or their pieces
  std::vector<bool> cut;           // of these: the window may have cut it
};

Verdict WandDetector::Impl::Search(const ImageView& image, const PixelRect& part) {
  window = part;
  blobs = &blob_finder.Find(image, part);
  standing_out.clear();
  cut.clear();
  const auto keep = [&](const Blob& blob, bool is_cut) {
    if (!StandsOut(image, blob)) return;
    // The box of one blob may hold a part of another's pieces.
    for (size_t i = 0; i < standing_out.size(); ++i) {
      Blob& known = standing_out[i];
      const double squared_px2 = (known.centre_px - blob.centre_px).squaredNorm();
      if (squared_px2 * std::numbers::pi >= std::max(known.area_px, blob.area_px)) continue;
      if (kPart * std::min(known.area_px, blob.area_px) < std::max(known.area_px, blob.area_px)) {
        continue;  // not the same thing
      }
      if (blob.area_px <= known.area_px) return;
      known = blob;
      cut[i] = is_cut;
      return;
    }
    standing_out.push_back(blob);
    cut.push_back(is_cut);
  };
  for (const Blob& blob : blobs->blobs) {
    const bool is_cut = TouchesEdge(blob.box, part, image.Bounds());
    const bool round = IsRound(blob);
    if (round) keep(blob, is_cut);
    // Of a large round one a marker may be a part: a sphere in front of a warm lampshade.
    if (round && blob.area_px < kLargeAreaPx) continue;
    for (const Blob& piece : splitter.Split(image, blob, options.min_area_px)) {
      keep(piece, is_cut);
    }
  }
  return verifier.Verify(image, standing_out, wand_finder, wand_finder.Find(standing_out));
}

std::optional<VerifiedWand> WandDetector::Impl::SearchTracked(const ImageView& image,
                                                              int64_t time_ns,
                                                              uint32_t clock_epoch) {
  const auto part = track.Window(time_ns, clock_epoch, image.Bounds());
  if (!part.has_value()) return std::nullopt;
  const Verdict verdict = Search(image, *part);
  if (!verdict.wand.has_value() || verdict.wand->OccludedCount() > 0) return std::nullopt;
  for (const int blob : verdict.wand->blobs) {
    if (cut[static_cast<size_t>(blob)]) return std::nullopt;
  }
  return verdict.wand;
}

MarkerObservation WandDetector::Impl::Observe(const VerifiedWand& wand, size_t k) const {
  MarkerObservation marker;
  marker.label_confidence = static_cast<float>(wand.label_confidence);
  if (!wand.whole[k]) return marker;
  const MarkerCentre& centre = wand.centres[k];
  marker.visible = true;
  marker.centre_px = centre.centre_px;
  marker.covariance_px2 =
      centre.covariance_px2 + kModelSigmaPx * kModelSigmaPx * Eigen::Matrix2d::Identity();
  if (const auto velocity = track.Velocity(k); velocity.has_value()) {
    const Eigen::Vector2d spread_px = light_sigma_s * *velocity;
    marker.covariance_px2 += spread_px * spread_px.transpose();
  }
  wand_finder.ToSphereCentre(wand.fit, k, &marker);
  return marker;
}

void WandDetector::Impl::Follow(const VerifiedWand& wand, Detection* detection) {
  Observation& observation = detection->observation;
  detection->confidence = wand.confidence;
  detection->occluded_markers = wand.OccludedCount();
  WandTrack::Points centres;
  double radius_px = 0;
  for (const MarkerCentre& centre : wand.centres) {
    centres.push_back(centre.centre_px);
    radius_px = std::max(radius_px, centre.radius_px);
  }
  track.Add(observation.time_ns, observation.clock_epoch, centres, radius_px);
  for (size_t k = 0; k < wand.blobs.size(); ++k) observation.markers[k] = Observe(wand, k);
}

DetectionOutcome WandDetector::Impl::WhyNone(const ImageView& image, const Verdict& verdict) const {
  const ImageExposure exposure = LookAtExposure(image);
  if (exposure == ImageExposure::kSaturated) return DetectionOutcome::kSaturated;
  if (verdict.ambiguous) return DetectionOutcome::kAmbiguous;
  if (blobs->over_limit > 0) return DetectionOutcome::kTooManyBlobs;
  if (!blobs->blobs.empty()) return DetectionOutcome::kNoWand;
  return exposure == ImageExposure::kBlack ? DetectionOutcome::kBlack : DetectionOutcome::kNoBlob;
}

WandDetector::WandDetector(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WandDetector::WandDetector(WandDetector&&) noexcept = default;
WandDetector& WandDetector::operator=(WandDetector&&) noexcept = default;
WandDetector::~WandDetector() = default;

absl::StatusOr<WandDetector> WandDetector::Create(const WandDetectorOptions& options,
                                                  const Target& target,
                                                  const CameraDescription& camera) {
  absl::Status status = options.Validate();
  status.Update(CheckTargetAndCamera(target, camera));
  auto blob_finder = BlobFinder::Create(options);
  status.Update(blob_finder.status());
  if (!status.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", camera.camera, ": ", std::string(status.message())));
  }
  return WandDetector(std::make_unique<Impl>(options, target, camera, *std::move(blob_finder)));
}

absl::Status WandDetector::SetIgnored(PixelMask ignored) {
  const ImageSize size = impl_->camera.image_size_px;
  if (ignored.width() != static_cast<int>(size.width) ||
      ignored.height() != static_cast<int>(size.height)) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", impl_->camera.camera, ": the mask has ", ignored.width(), "x",
                     ignored.height(), " pixels, the images ", size.width, "x", size.height,
                     "; learn it again with `rigcal-agent mask`"));
  }
  impl_->blob_finder.SetIgnored(std::move(ignored));
  return absl::OkStatus();
}

absl::StatusOr<Detection> WandDetector::Detect(const ImageView& image, int64_t time_ns,
                                               uint32_t clock_epoch) {
  const ImageSize size = impl_->camera.image_size_px;
  if (image.data == nullptr || image.width != static_cast<int>(size.width) ||
      image.height != static_cast<int>(size.height)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "camera ", impl_->camera.camera, ": an image of ", image.width, "x", image.height,
        " pixels", image.data == nullptr ? " without data" : "", ", its description says ",
        size.width, "x", size.height, "; set the camera's region or its calibration right"));
  }
  Detection detection;
  detection.observation.time_ns = time_ns;
  detection.observation.clock_epoch = clock_epoch;
  detection.observation.markers.resize(static_cast<size_t>(impl_->target.marker_count()));

  std::optional<VerifiedWand> wand;
  if (impl_->options.tracking) wand = impl_->SearchTracked(image, time_ns, clock_epoch);
  detection.tracked = wand.has_value();
  detection.outcome = DetectionOutcome::kWand;
  if (!wand.has_value()) {
    const Verdict verdict = impl_->Search(image, image.Bounds());
    wand = verdict.wand;
    if (!wand.has_value()) detection.outcome = impl_->WhyNone(image, verdict);
  }
  detection.blob_count = static_cast<int>(impl_->blobs->blobs.size());
  if (wand.has_value()) {
    impl_->Follow(*wand, &detection);
  } else {
    impl_->track.Forget();
  }
  return detection;
}

PixelRect WandDetector::window() const { return impl_->window; }
absl::Span<const Blob> WandDetector::blobs() const {
  if (impl_->blobs == nullptr) return {};
  return impl_->blobs->blobs;
}

}  // namespace rigcal::agent
