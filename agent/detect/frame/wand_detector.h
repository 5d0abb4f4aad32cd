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
  // Exposure in seconds; 0: not known. When in it a blinking LED was lit is not known. This adds to
  // the covariance by the blink frequency and the image velocity of a followed wand; of one not
  // followed yet only if the exposure is shorter than a blink, by a hand's usual speed.
  double exposure_s = 0;
  WandMechanisms without;  // parts of the search that are left out, for experiments

  // Returns all faults in one message.
  absl::Status Validate() const;
};

struct WandExplanation {
  Detection detection;
  std::vector<WandTrial> trials;
};

// Finds the wand in the images of one camera: blobs of its colour, sets of them that can be the
// target's markers in perspective, and sub-pixel centres of the best set. With intrinsics and the
// spheres' diameter a centre is the projection of the sphere's centre (CentreKind::kSphereCentre),
// else the centre of its image. Movable; one thread at a time.
//
// The time of a search is bounded: of too many things of the wand's colour it leaves out large
// patches and the less likely candidates, always the same (Detection::cut_short,
// dismissed_patches).
class WandDetector : public FrameDetector {
 public:
  // Fails with INVALID_ARGUMENT if options, target or camera are not valid; names the camera.
  static absl::StatusOr<WandDetector> Create(const WandDetectorOptions& options,
                                             const Target& target, const CameraDescription& camera);

  // Sets pixels (StaticMaskLearner), in a mask of the images' size, that never belong to a marker.
  void SetIgnored(const PixelMask& ignored) override { search_.spot_finder().SetIgnored(ignored); }
  // Also ignores this background while pixels look like it; null: none. It outlives the detector.
  void SetBackground(StaticBackground* background) override {
    search_.spot_finder().SetBackground(background);
  }

  // Searches the whole image like Detect, and returns every candidate that was examined, the most
  // likely first. Forgets the wand that was followed.
  absl::StatusOr<WandExplanation> Explain(const ImageView& image);

  // `time_ns` is the middle of the exposure on the camera's clock. A followed wand is looked for
  // around where it is expected; a search of the whole image would find the same there. Fails with
  // INVALID_ARGUMENT if the image has no pixels or is not of the camera's size.
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
  // Detection::light_level.
  static std::optional<double> LightLevel(const VerifiedWand& wand);
  DetectionOutcome WhyNone(const ImageView& image, const Verdict& verdict) const;

  WandDetectorOptions options_;
  Target target_;
  CameraDescription camera_;
  WandSearch search_;
  double short_light_sigma_s_, light_sigma_s_;  // see WandDetectorOptions::exposure_s
  WandTrack track_;
};

}  // namespace rigcal::agent
