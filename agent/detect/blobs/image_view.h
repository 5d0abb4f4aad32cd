// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace rigcal::agent {

enum class PixelFormat : uint8_t {
  kMono8 = 1,  // one byte: brightness
  kBgr8 = 2,   // three bytes: blue, green, red, as OpenCV keeps them
};

constexpr int BytesPerPixel(PixelFormat format) { return format == PixelFormat::kBgr8 ? 3 : 1; }

// A rectangle in an image: columns [x, x + width), rows [y, y + height).
struct PixelRect {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;

  friend bool operator==(const PixelRect&, const PixelRect&) = default;
  bool empty() const { return width <= 0 || height <= 0; }
};

// An image that the caller owns. Row y begins at data + y * stride_bytes; padding is not read.
struct ImageView {
  const uint8_t* data = nullptr;
  int width = 0;   // pixels
  int height = 0;  // pixels
  ptrdiff_t stride_bytes = 0;
  PixelFormat format = PixelFormat::kBgr8;

  const uint8_t* Row(int y) const { return data + y * stride_bytes; }
  PixelRect Bounds() const { return {0, 0, width, height}; }
};

}  // namespace rigcal::agent
