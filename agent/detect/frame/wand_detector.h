// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/colour_range.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/detect/blobs/pixel_mask.h"
#include "agent/identify/detection.h"
#include "common/camera/camera_description.h"
#include "common/target/detection_outcome.h"
#include "common/target/observation.h"
#include "common/target/target.h"

namespace rigcal::agent {

struct WandDetectorOptions {
  ColourRange colour;
  int min_area_px = 6;            // of a blob, >= 1
  int max_area_px = 600000;       // of a blob; markers are looked for in large ones too
  int max_blobs = 512;            // the largest are considered, 2 to 4096
  double min_contrast_grey = 50;  // of a marker against what is around it, all channels, 1 to 441
  // Of every marker, where intrinsics and spacing are known; metres.
  double min_distance_m = 0.3;
  double max_distance_m = 20;
  // Of the wand out of the plane across the line of sight; more makes short, uncertain wands. 10 to
  // 89 degrees.
  double max_tilt_deg = 82;
  double min_confidence = 0.5;  // less is no wand, 0 to 1
  bool tracking = true;         // look where the wand is expected before searching the image
  // Seconds; 0: not known. With the target's blink frequency and the image velocity of a followed
  // wand, what the LED's phase leaves open is part of the covariance.
  double exposure_s = 0;

  // Every fault.
  absl::Status Validate() const;
};

// Since Create.
struct WandDetectorCounts {
  uint64_t frames = 0;
  uint64_t wands = 0;
  uint64_t tracked = 0;  // of `wands`
  uint64_t occluded_markers = 0;
  DetectionCounts by_outcome;
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

  // The next image is searched whole.
  void ForgetTrack();
  const WandDetectorCounts& counts() const;
  const WandDetectorOptions& options() const;

 private:
  struct Impl;
  explicit WandDetector(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal::agent
