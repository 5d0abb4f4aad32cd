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

// A picture with what the detector made of it, copied so that the camera goes on meanwhile.
struct PreviewFrame {
  PreviewFrame() = default;
  // A copy's `image` would still be that of the original.
  PreviewFrame(PreviewFrame&&) = default;
  PreviewFrame& operator=(PreviewFrame&&) = default;

  std::vector<uint8_t> pixels;  // rows without padding
  ImageView image;              // of `pixels`
  int64_t time_ns = 0;          // the camera's clock
  uint32_t clock_epoch = 0;
  Detection detection;
  PixelRect window;         // looked at while tracking; empty: the whole picture
  std::vector<Blob> blobs;  // as many as the detector tells
};

// Where a source hands out a picture when somebody asks for one. Asking is for any thread, offering
// for the one that captures. Costs the capture a look at a flag per picture, and the copy of one
// picture per request.
class PreviewTap {
 public:
  using Take = std::function<void(PreviewFrame)>;

  PreviewTap() = default;
  PreviewTap(const PreviewTap&) = delete;
  PreviewTap& operator=(const PreviewTap&) = delete;

  // The next picture offered is copied for `take`, which is called by the capturing thread and must
  // not block. One that still waits is forgotten.
  void Request(Take take);
  // Nobody waits any more. After the return `take` is neither running nor called.
  void Cancel();

  // What the detector made of a picture. `image` is read during the call only.
  void Offer(const ImageView& image, int64_t time_ns, uint32_t clock_epoch,
             const Detection& detection, const PixelRect& window = {},
             absl::Span<const Blob> blobs = {});

 private:
  std::mutex mutex_;
  std::atomic<bool> wanted_{false};  // there is a take_
  Take take_;
};

}  // namespace rigcal::agent
