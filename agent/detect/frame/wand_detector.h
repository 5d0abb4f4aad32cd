// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "agent/identify/detection.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

// max_blobs: 2 to 4096.
struct WandDetectorOptions : BlobFinderOptions, WandLimits {
  bool tracking = true;  // look where the wand is expected before searching the image
  // Seconds; 0: not known. With the target's blink frequency and the image velocity of a followed
  // wand, what the LED's phase leaves open is part of the covariance.
  double exposure_s = 0;

  // Every fault.
  absl::Status Validate() const;
};

// Finds the wand in the images of one camera: blobs of its colour, sets of them that can be the
// target's markers seen in perspective, sub-pixel centres of the best set. With intrinsics and the
// spheres' diameter a centre is the projection of the sphere's centre (CentreKind::kSphereCentre),
// else the centre of its image. Movable; one thread at a time.
class WandDetector {
 public:
  // INVALID_ARGUMENT: options, target or camera not valid; names the camera.
  static absl::StatusOr<WandDetector> Create(const WandDetectorOptions& options,
                                             const Target& target, const CameraDescription& camera);
  WandDetector(WandDetector&&) noexcept;
  WandDetector& operator=(WandDetector&&) noexcept;
  ~WandDetector();

  // Pixels that never belong to a marker from now on (StaticMask). INVALID_ARGUMENT: not of the
  // images' size.
  absl::Status SetIgnored(PixelMask ignored);

  // `time_ns`: the middle of the exposure on the camera's clock. A wand that is followed is looked
  // for around where it is expected; what is found there is what a search of the whole image
  // finds. INVALID_ARGUMENT: the image has no pixels or is not of the camera's size.
  absl::StatusOr<Detection> Detect(const ImageView& image, int64_t time_ns, uint32_t clock_epoch);

  // Window and blobs of the last Detect; valid until the next call.
  PixelRect window() const;
  absl::Span<const Blob> blobs() const;

 private:
  struct Impl;
  explicit WandDetector(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal::agent
