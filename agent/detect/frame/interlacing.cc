// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/interlacing.h"

#include <algorithm>
#include <vector>

namespace rigcal::agent {
namespace {

constexpr int kLeastAreaPx = 40, kMostAreaPx = 10000;  // of a sphere's image
constexpr size_t kMostBlobs = 4;                       // blobs that are examined
// Squared second differences between rows over squared differences of the rows above and below: 1
// for a sharp disc, less with blur, 2 with teeth of half a pixel.
constexpr int64_t kTeeth = 2;

bool HasTeeth(const ImageView& image, const PixelRect& box) {
  const int bytes = BytesPerPixel(image.format);
  const int top = std::max(box.y - 1, 1);
  const int bottom = std::min(box.y + box.height + 1, image.height - 1);
  int64_t teeth = 0, smooth = 0;
  for (int y = top; y < bottom; ++y) {
    const uint8_t* const row = image.Row(y);
    const uint8_t* const before = image.Row(y - 1);
    const uint8_t* const after = image.Row(y + 1);
    for (int i = box.x * bytes; i < (box.x + box.width) * bytes; ++i) {
      const int twice = 2 * row[i] - before[i] - after[i], across = after[i] - before[i];
      teeth += twice * twice;
      smooth += across * across;
    }
  }
  return teeth > kTeeth * smooth;
}

}  // namespace

bool LooksInterlaced(const ImageView& image, absl::Span<const Blob> blobs) {
  std::vector<const Blob*> largest;
  for (const Blob& blob : blobs) {
    if (blob.area_px >= kLeastAreaPx && blob.area_px <= kMostAreaPx) largest.push_back(&blob);
  }
  const size_t count = std::min(kMostBlobs, largest.size());
  std::ranges::partial_sort(largest, largest.begin() + static_cast<int64_t>(count),
                            std::ranges::greater(), [](const Blob* blob) { return blob->area_px; });
  return std::any_of(largest.begin(), largest.begin() + static_cast<int64_t>(count),
                     [&](const Blob* blob) { return HasTeeth(image, blob->box); });
}

}  // namespace rigcal::agent
