// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "common/camera/intrinsics.h"
#include "common/target/detection_outcome.h"

namespace rigcal {

// Asks an agent for the next frame of a camera, with the detections in it.
struct PreviewRequest {
  uint32_t request_id = 0;  // >= 1
  std::string camera;
  uint32_t max_jpeg_bytes = 0;
  uint32_t max_wait_ms = 0;
};

// Whether a preview has an image, and if not, why.
enum class PreviewStatus : uint8_t {
  kOk = 1,
  kDisabled = 2,
  kUnknownCamera = 3,
  kNoFrames = 4,
  kNotCapturing = 5,
  kTooOften = 6,
  kTimedOut = 7,
  kFailed = 8,
};

// The frame of a preview.
struct PreviewInfo {
  std::string camera;
  int64_t time_ns = 0;  // the camera's clock, the middle of the exposure
  uint32_t clock_epoch = 0;
  ImageSize image_size_px;
  ImageSize jpeg_size_px;  // smaller where the whole image would be too large to send
  DetectionOutcome outcome = DetectionOutcome::kNoBlob;
  double confidence = 0;  // 0 to 1
  uint32_t visible_marker_count = 0;
  uint32_t blob_count = 0;
  bool tracked = false;

  friend bool operator==(const PreviewInfo&, const PreviewInfo&) = default;
};

// The answer to a PreviewRequest.
struct Preview {
  uint32_t request_id = 0;
  PreviewStatus status = PreviewStatus::kOk;
  std::string message;  // unless kOk: why, and what to do
  PreviewInfo info;     // with kOk, as the JPEG
  std::string jpeg;
};

}  // namespace rigcal
