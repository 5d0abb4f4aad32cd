// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/static_background.h"
#include "agent/identify/detection.h"
#include "common/camera/camera_description.h"
#include "common/target/target.h"

namespace rigcal::agent {

struct WandDetectorOptions;

// Finds a target in the images of one camera. One thread at a time.
class FrameDetector {
 public:
  virtual ~FrameDetector() = default;

  // Sets pixels, in a mask of the images' size, that never belong to the target.
  virtual void SetIgnored(const PixelMask& ignored) = 0;
  // Also ignores this background while pixels look like it; null: none. It outlives the detector.
  virtual void SetBackground(StaticBackground* background) = 0;

  // `time_ns` is the middle of the exposure on the camera's clock. Fails with INVALID_ARGUMENT if
  // the image has no pixels or is not of the camera's size.
  virtual absl::StatusOr<Detection> Detect(const ImageView& image, int64_t time_ns,
                                           uint32_t clock_epoch) = 0;

  // The part of the image that the last Detect searched, and its blobs; until the next call.
  virtual PixelRect window() const = 0;
  virtual absl::Span<const Blob> blobs() const = 0;

 protected:
  FrameDetector() = default;
  FrameDetector(const FrameDetector&) = default;
  FrameDetector(FrameDetector&&) = default;
  FrameDetector& operator=(const FrameDetector&) = default;
  FrameDetector& operator=(FrameDetector&&) = default;
};

// INVALID_ARGUMENT, with the camera's name: the image has no pixels or is not of the camera's size.
absl::Status CheckImage(const CameraDescription& camera, const ImageView& image);

// A detector for a kind of target. To add one, add a row to the table in frame_detectors.cc.
struct FrameDetectorKind {
  const char* name;  // "wand"
  bool (*finds)(const Target& target);
  absl::StatusOr<std::unique_ptr<FrameDetector>> (*make)(const WandDetectorOptions& options,
                                                         const Target& target,
                                                         const CameraDescription& camera);
};
absl::Span<const FrameDetectorKind> FrameDetectorKinds();

// Makes a detector of the first kind that finds the target. FAILED_PRECONDITION: there is none;
// INVALID_ARGUMENT: options, target or camera are not valid. Messages name the camera.
absl::StatusOr<std::unique_ptr<FrameDetector>> MakeFrameDetector(const WandDetectorOptions& options,
                                                                 const Target& target,
                                                                 const CameraDescription& camera);

}  // namespace rigcal::agent
