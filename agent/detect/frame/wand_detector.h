// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "agent/detect/frame/spot_finder.h"
#include "agent/detect/frame/wand_track.h"
#include "agent/identify/detection.h"
#include "agent/identify/wand_verifier.h"

namespace rigcal::agent {

// max_blobs: 2 to 4096.
struct WandDetectorOptions : BlobFinderOptions, WandLimits {
  // In a lit room a false wand costs more than a missed one.
  WandDetectorOptions() { min_confidence = 0.7; }

  bool tracking = true;  // look where the wand is expected before searching the image
  // Seconds; 0: not known. With the target's blink frequency and the image velocity of a followed
  // wand, what the LED's phase leaves open is part of the covariance. Where the exposure is shorter
  // than a blink and the wand is not followed yet, with the usual speed of a hand.
  double exposure_s = 0;

  // Every fault.
  absl::Status Validate() const;
};

// Finds the wand in the images of one camera: blobs of its colour, sets of them that can be the
// target's markers seen in perspective, sub-pixel centres of the best set. With intrinsics and the
// spheres' diameter a centre is the projection of the sphere's centre (CentreKind::kSphereCentre),
// else the centre of its image. Movable; one thread at a time.
//
// The time of a search is bounded: of an image with too many things of the wand's colour the search
// leaves out large patches and the less likely candidates, always the same ones
// (Detection::cut_short, dismissed_patches).
class WandDetector {
 public:
  // INVALID_ARGUMENT: options, target or camera not valid; names the camera.
  static absl::StatusOr<WandDetector> Create(const WandDetectorOptions& options,
                                             const Target& target, const CameraDescription& camera);

  // Pixels that never belong to a marker from now on (StaticMask), of the images' size.
  void SetIgnored(const PixelMask& ignored) { spot_finder_.SetIgnored(ignored); }
  // Nor those of this background, while they look like it; null: none. It outlives the detector.
  void SetBackground(StaticBackground* background) { spot_finder_.SetBackground(background); }

  // `time_ns`: the middle of the exposure on the camera's clock. A wand that is followed is looked
  // for around where it is expected; what is found there is what a search of the whole image
  // finds. INVALID_ARGUMENT: the image has no pixels or is not of the camera's size.
  absl::StatusOr<Detection> Detect(const ImageView& image, int64_t time_ns, uint32_t clock_epoch);

  // Window and blobs of the last Detect; valid until the next call.
  PixelRect window() const { return window_; }
  absl::Span<const Blob> blobs() const { return result().blobs; }

 private:
  WandDetector(const WandDetectorOptions& options, const Target& target,
               const CameraDescription& camera, SpotFinder spot_finder);
  const BlobResult& result() const { return spot_finder_.result(); }
  double ShareOf(int64_t count_px) const;
  bool IsCrowded() const;
  bool IsLit(const ImageView& image);
  double EstimatedMs() const;
  double Unlikeness(const WandCandidate& candidate) const;
  bool IsSure(const VerifiedWand& wand) const;
  Verdict VerifyFound(const ImageView& image, double most_work);
  Verdict Search(const ImageView& image, const PixelRect& part, size_t level);
  Verdict SearchPartial(const ImageView& image, double kept_work);
  void TryWhole(const ImageView& image, VerifiedWand* wand);
  Verdict SearchAll(const ImageView& image);
  Verdict SearchLevels(const ImageView& image, std::optional<VerifiedWand>* of_parts);
  std::optional<VerifiedWand> SearchTracked(const ImageView& image, int64_t time_ns,
                                            uint32_t clock_epoch);
  MarkerObservation Observe(const VerifiedWand& wand, size_t marker) const;
  void Follow(const VerifiedWand& wand, Detection* detection);
  DetectionOutcome WhyNone(const ImageView& image, const Verdict& verdict) const;

  WandDetectorOptions options_;
  Target target_;
  CameraDescription camera_;
  WandFinder wand_finder_;
  WandVerifier verifier_;
  double short_light_sigma_s_, light_sigma_s_;  // see WandDetectorOptions::exposure_s
  WandTrack track_;
  PixelRect window_;
  SpotFinder spot_finder_;
  std::vector<Blob> standing_out_;      // the spots' blobs
  std::vector<Eigen::Vector3f> cores_;  // their middles
  std::vector<double> doubts_;          // and doubts
  std::vector<WandCandidate> candidates_;
  // Of this image: what its search may still cost, and whether anything was left out for that.
  int fits_left_ = 0;
  double work_left_ = 0;
  bool cut_short_ = false;
  bool has_rivals_ = false;  // the last Search measured two wands that are equally good
  double passed_share_ = 0, white_share_ = 0;
  std::optional<bool> is_lit_;  // more than a dark room's spots; none: not looked at yet
};

}  // namespace rigcal::agent
