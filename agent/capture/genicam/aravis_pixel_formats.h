// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// Memory layout of the samples of a GenICam image (EMVA's Pixel Format Naming Convention).
enum class SamplePacking : uint8_t {
  k8,       // one byte each
  k16,      // two bytes, low byte first, the value in the low bits
  kPacked,  // "Packed" of GigE Vision: two samples in three bytes, high bits in bytes 0 and 2
  kBits,    // "p": one stream of bits, low bits first
};
enum class SampleLayout : uint8_t { kMono, kRgb, kBgr, kBayerRg, kBayerGr, kBayerGb, kBayerBg };

struct GenicamPixelFormat {
  uint32_t code = 0;  // as on the wire
  const char* name = "";
  SampleLayout layout = SampleLayout::kMono;
  SamplePacking packing = SamplePacking::k8;
  int bits = 8;  // of a sample: 8, 10 or 12

  // Mono8 and BGR8 are used without conversion.
  bool zero_copy() const {
    return packing == SamplePacking::k8 &&
           (layout == SampleLayout::kMono || layout == SampleLayout::kBgr);
  }
  PixelFormat output() const {
    return layout == SampleLayout::kMono ? PixelFormat::kMono8 : PixelFormat::kBgr8;
  }
};

// None: not supported.
std::optional<GenicamPixelFormat> FindPixelFormat(uint32_t code);
std::optional<GenicamPixelFormat> FindPixelFormat(std::string_view name);
// Names, best first for finding a coloured wand: colour before grey, 8 bit before more.
const std::vector<std::string>& SupportedPixelFormats();

// The image in `data`. Samples of 10 and 12 bits keep their highest 8; Bayer patterns are
// interpolated. `line_padding_bytes` follow each line. The view is of `data` if the format allows,
// else of `*converted`, which must outlive it and should be reused. INVALID_ARGUMENT: `size_bytes`
// is too small for such an image, or a side is not positive.
// INTERNAL: OpenCV refused.
absl::StatusOr<ImageView> ViewPixels(const GenicamPixelFormat& format, const uint8_t* data,
                                     size_t size_bytes, int width, int height,
                                     int line_padding_bytes, std::vector<uint8_t>* converted);

}  // namespace rigcal::agent
