// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// How the samples of one pixel lie in a GenICam picture (EMVA's Pixel Format Naming Convention).
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

  // Mono8 and BGR8 are handed on as they lie in the buffer.
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

// The picture that lies in `data`. Samples of 10 and 12 bits keep their highest 8; Bayer patterns
// are interpolated. `line_padding_bytes` follow each line. The view lies in `data` itself where the
// format allows, else in `*converted`, which must outlive it and is best used again.
// INVALID_ARGUMENT: `size_bytes` is less than such a picture has, or a side is not positive.
// INTERNAL: OpenCV refused.
absl::StatusOr<ImageView> ViewPixels(const GenicamPixelFormat& format, const uint8_t* data,
                                     size_t size_bytes, int width, int height,
                                     int line_padding_bytes, std::vector<uint8_t>* converted);

}  // namespace rigcal::agent
