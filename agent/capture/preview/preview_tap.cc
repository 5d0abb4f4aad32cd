// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/preview/preview_tap.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace rigcal::agent {
namespace {

void CopyPixels(const ImageView& image, PreviewFrame* frame) {
  const auto row_bytes =
      static_cast<size_t>(image.width) * static_cast<size_t>(BytesPerPixel(image.format));
  frame->pixels.resize(row_bytes * static_cast<size_t>(image.height));
  uint8_t* to = frame->pixels.data();
  for (int y = 0; y < image.height; ++y, to += row_bytes) {
    std::copy_n(image.Row(y), row_bytes, to);
  }
  frame->image = {.data = frame->pixels.data(),
                  .width = image.width,
                  .height = image.height,
                  .stride_bytes = static_cast<ptrdiff_t>(row_bytes),
                  .format = image.format};
}

}  // namespace

void PreviewTap::Request(Take take) {
  const std::lock_guard lock(mutex_);
  take_ = std::move(take);
  wanted_ = true;
}

void PreviewTap::Cancel() {
  const std::lock_guard lock(mutex_);
  take_ = nullptr;
  wanted_ = false;
}

void PreviewTap::Offer(const ImageView& image, int64_t time_ns, uint32_t clock_epoch,
                       const Detection& detection, const PixelRect& window,
                       absl::Span<const Blob> blobs) {
  if (!wanted_.load(std::memory_order_relaxed)) return;
  PreviewFrame frame;
  CopyPixels(image, &frame);
  frame.time_ns = time_ns;
  frame.clock_epoch = clock_epoch;
  frame.detection = detection;
  frame.window = window;
  frame.blobs.assign(blobs.begin(), blobs.end());
  const std::lock_guard lock(mutex_);
  wanted_ = false;
  // The vector's memory stays where it is when it is moved, and with it the view.
  if (const Take take = std::exchange(take_, nullptr)) take(std::move(frame));
}

}  // namespace rigcal::agent
