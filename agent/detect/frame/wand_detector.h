// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "agent/detect/frame/frame_detector.h"
#include "agent/detect/frame/wand_search.h"
#include "agent/detect/frame/wand_track.h"
#include "agent/identify/detection.h"
#include "agent/identify/wand_mechanisms.h"

namespace rigcal::agent {

// max_blobs: 2 to 4096.
struct WandDetectorOptions : BlobFinderOptions, WandLimits {
  // In a lit room a false wand costs more than a missed one.
  WandDetectorOptions() { min_confidence = 0.6; }

  bool tracking = true;  // look where the wand is expected before searching the image
  // Seconds; 0: not known. With the target's blink frequency and the image velocity of a followed
  // wand, what the LED's phase leaves open is part of the covariance. Where the exposure is shorter
  // than a blink and the wand is not followed yet, with the usual speed of a hand.
  double exposure_s = 0;
  WandMechanisms without;  // what is left out of the search, for experiments

  // Every fault.
  absl::Status Validate() const;
};

struct WandExplanation {
  Detection detection;
  std::vector<WandTrial> trials;
};

// Finds the wand in the images of one camera: blobs of its colour, sets of them that can be the
// target's markers seen in perspective, sub-pixel centres of the best set. With intrinsics and the
// spheres' diameter a centre is the projection of the sphere's centre (CentreKind::kSphereCentre),
// else the centre of its image. Movable; one thread at a time.
//
// The time of a search is bounded: of an image with too many things of the wand's colour the search
// leaves out large patches and the less likely candidates, always the same ones
// (Detection::cut_short, dismissed_patches).
class WandDetector : public FrameDetector {
 public:
  // INVALID_ARGUMENT: options, target or camera not valid; names the camera.
  static absl::StatusOr<WandDetector> Create(const WandDetectorOptions& options,
                                             const Target& target, const CameraDescription& camera);

  // Pixels that never belong to a marker from now on (StaticMaskLearner), of the images' size.
  void SetIgnored(const PixelMask& ignored) override { search_.spot_finder().SetIgnored(ignored); }
  // Nor those of this background, while they look like it; null: none. It outlives the detector.
  void SetBackground(StaticBackground* background) override {
    search_.spot_finder().SetBackground(background);
  }

  // Detect in the whole image, with every candidate that was looked at, the most likely first. The
  // wand that was followed is forgotten.
  absl::StatusOr<WandExplanation> Explain(const ImageView& image);

  // `time_ns`: the middle of the exposure on the camera's clock. A wand that is followed is looked
  // for around where it is expected; what is found there is what a search of the whole image
  // finds. INVALID_ARGUMENT: the image has no pixels or is not of the camera's size.
  absl::StatusOr<Detection> Detect(const ImageView& image, int64_t time_ns,
                                   uint32_t clock_epoch) override;

  // Window and blobs of the last Detect; valid until the next call.
  PixelRect window() const override { return search_.window(); }
  absl::Span<const Blob> blobs() const override { return search_.result().blobs; }

 private:
  WandDetector(const WandDetectorOptions& options, const Target& target,
               const CameraDescription& camera, SpotFinder spot_finder);
  std::optional<VerifiedWand> SearchTracked(const ImageView& image, int64_t time_ns,
                                            uint32_t clock_epoch);
  MarkerObservation Observe(const VerifiedWand& wand, size_t marker) const;
  void Follow(const VerifiedWand& wand, Detection* detection);
  DetectionOutcome WhyNone(const ImageView& image, const Verdict& verdict) const;

  WandDetectorOptions options_;
  Target target_;
  CameraDescription camera_;
  WandSearch search_;
  double short_light_sigma_s_, light_sigma_s_;  // see WandDetectorOptions::exposure_s
  WandTrack track_;
};

}  // namespace rigcal::agent
