// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <vector>

#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/detect/frame/wand_detector.h"

namespace rigcal::agent {

// A copy of a frame with its detections.
struct PreviewFrame {
  PreviewFrame() = default;
  // A copy's `image` would still refer to the original.
  PreviewFrame(PreviewFrame&&) = default;
  PreviewFrame& operator=(PreviewFrame&&) = default;

  std::vector<uint8_t> pixels;  // rows without padding
  ImageView image;              // of `pixels`
  int64_t time_ns = 0;          // the camera's clock
  uint32_t clock_epoch = 0;
  Detection detection;
  PixelRect window;         // searched while tracking; empty: the whole frame
  std::vector<Blob> blobs;  // of the detector
};

// Hands out a frame of a source on request. Any thread may request; the capturing thread offers. A
// capture pays for reading a flag per frame and for one copy per request.
class PreviewTap {
 public:
  using Take = std::function<void(PreviewFrame)>;

  PreviewTap() = default;
  PreviewTap(const PreviewTap&) = delete;
  PreviewTap& operator=(const PreviewTap&) = delete;

  // The next frame offered is copied for `take`, which the capturing thread calls; it must not
  // block. A pending request is replaced.
  void Request(Take take);
  // Drops a pending request. After the return `take` is neither running nor called.
  void Cancel();

  // A frame and its detections. `image` is read during the call only.
  void Offer(const ImageView& image, int64_t time_ns, uint32_t clock_epoch,
             const Detection& detection, const PixelRect& window = {},
             absl::Span<const Blob> blobs = {});

 private:
  std::mutex mutex_;
  std::atomic<bool> wanted_{false};  // there is a take_
  Take take_;
};

}  // namespace rigcal::agent
