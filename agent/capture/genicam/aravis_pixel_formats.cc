// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_pixel_formats.h"

#include <algorithm>
#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

using enum SampleLayout;
using enum SamplePacking;

// In the order of preference. Codes: EMVA PFNC, which GigE Vision and USB3 Vision share.
constexpr std::array<GenicamPixelFormat, 37> kFormats{{
    {0x02180015, "BGR8", kBgr, k8, 8},
    {0x02180014, "RGB8", kRgb, k8, 8},
    {0x01080009, "BayerRG8", kBayerRg, k8, 8},
    {0x01080008, "BayerGR8", kBayerGr, k8, 8},
    {0x0108000A, "BayerGB8", kBayerGb, k8, 8},
    {0x0108000B, "BayerBG8", kBayerBg, k8, 8},
    {0x010A0058, "BayerRG10p", kBayerRg, kBits, 10},
    {0x010A0056, "BayerGR10p", kBayerGr, kBits, 10},
    {0x010A0054, "BayerGB10p", kBayerGb, kBits, 10},
    {0x010A0052, "BayerBG10p", kBayerBg, kBits, 10},
    {0x010C0059, "BayerRG12p", kBayerRg, kBits, 12},
    {0x010C0057, "BayerGR12p", kBayerGr, kBits, 12},
    {0x010C0055, "BayerGB12p", kBayerGb, kBits, 12},
    {0x010C0053, "BayerBG12p", kBayerBg, kBits, 12},
    {0x010C0027, "BayerRG10Packed", kBayerRg, kPacked, 10},
    {0x010C0026, "BayerGR10Packed", kBayerGr, kPacked, 10},
    {0x010C0028, "BayerGB10Packed", kBayerGb, kPacked, 10},
    {0x010C0029, "BayerBG10Packed", kBayerBg, kPacked, 10},
    {0x010C002B, "BayerRG12Packed", kBayerRg, kPacked, 12},
    {0x010C002A, "BayerGR12Packed", kBayerGr, kPacked, 12},
    {0x010C002C, "BayerGB12Packed", kBayerGb, kPacked, 12},
    {0x010C002D, "BayerBG12Packed", kBayerBg, kPacked, 12},
    {0x0110000D, "BayerRG10", kBayerRg, k16, 10},
    {0x0110000C, "BayerGR10", kBayerGr, k16, 10},
    {0x0110000E, "BayerGB10", kBayerGb, k16, 10},
    {0x0110000F, "BayerBG10", kBayerBg, k16, 10},
    {0x01100011, "BayerRG12", kBayerRg, k16, 12},
    {0x01100010, "BayerGR12", kBayerGr, k16, 12},
    {0x01100012, "BayerGB12", kBayerGb, k16, 12},
    {0x01100013, "BayerBG12", kBayerBg, k16, 12},
    {0x01080001, "Mono8", kMono, k8, 8},
    {0x010C0004, "Mono10Packed", kMono, kPacked, 10},
    {0x010C0006, "Mono12Packed", kMono, kPacked, 12},
    {0x01100003, "Mono10", kMono, k16, 10},
    {0x01100005, "Mono12", kMono, k16, 12},
    {0x010A0046, "Mono10p", kMono, kBits, 10},
    {0x010C0047, "Mono12p", kMono, kBits, 12},
}};

size_t LineBytes(const GenicamPixelFormat& format, size_t width) {
  const size_t channels = format.layout == kRgb || format.layout == kBgr ? 3 : 1;
  switch (format.packing) {
    case k8:
      return width * channels;
    case k16:
      return width * 2;
    case kPacked:
      return (width * 3 + 1) / 2;
    case kBits:
      return (width * static_cast<size_t>(format.bits) + 7) / 8;
  }
  return 0;
}

// The highest 8 bits of each sample of one line.
void ReduceLine(const GenicamPixelFormat& format, const uint8_t* line, int width, uint8_t* out) {
  const int drop = format.bits - 8;
  switch (format.packing) {
    case k8:
      std::copy(line, line + width, out);
      return;
    case k16:
      for (int x = 0; x < width; ++x) {
        const int value = line[2 * x] | line[2 * x + 1] << 8;
        out[x] = static_cast<uint8_t>(std::min(value >> drop, 255));
      }
      return;
    case kPacked:
      for (int x = 0; x < width; ++x) out[x] = line[x / 2 * 3 + x % 2 * 2];
      return;
    case kBits:
      for (int x = 0; x < width; ++x) {
        const int first_bit = x * format.bits + drop;
        const int byte = first_bit / 8;
        const int shift = first_bit % 8;
        int value = line[byte] >> shift;
        if (shift != 0) value |= line[byte + 1] << (8 - shift);
        out[x] = static_cast<uint8_t>(value);
      }
      return;
  }
}

// OpenCV names a pattern by its second row, from the second column on.
int ColourConversion(SampleLayout layout) {
  switch (layout) {
    case kRgb:
      return cv::COLOR_RGB2BGR;
    case kBayerRg:
      return cv::COLOR_BayerBG2BGR;
    case kBayerGr:
      return cv::COLOR_BayerGB2BGR;
    case kBayerGb:
      return cv::COLOR_BayerGR2BGR;
    default:
      return cv::COLOR_BayerRG2BGR;
  }
}

absl::Status ToBgr(const GenicamPixelFormat& format, const uint8_t* pixels, size_t stride,
                   int width, int height, uint8_t* out) {
  try {
    const int type = format.layout == kRgb ? CV_8UC3 : CV_8UC1;
    const cv::Mat raw(height, width, type, const_cast<uint8_t*>(pixels), stride);
    cv::Mat bgr(height, width, CV_8UC3, out);
    cv::cvtColor(raw, bgr, ColourConversion(format.layout));
    if (bgr.data != out) return absl::InternalError("OpenCV did not use the memory it was given");
    return absl::OkStatus();
  } catch (const cv::Exception& error) {
    return absl::InternalError(
        absl::StrCat("cannot convert ", format.name, ": ", std::string(error.what())));
  }
}

}  // namespace

std::optional<GenicamPixelFormat> FindPixelFormat(uint32_t code) {
  const auto found = std::ranges::find(kFormats, code, &GenicamPixelFormat::code);
  return found == kFormats.end() ? std::nullopt : std::optional(*found);
}

std::optional<GenicamPixelFormat> FindPixelFormat(std::string_view name) {
  // GigE Vision 1 called these two by another name; the bytes are the same.
  if (name == "RGB8Packed") name = "RGB8";
  if (name == "BGR8Packed") name = "BGR8";
  const auto found = std::ranges::find(kFormats, name, &GenicamPixelFormat::name);
  return found == kFormats.end() ? std::nullopt : std::optional(*found);
}

const std::vector<std::string>& SupportedPixelFormats() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const GenicamPixelFormat& format : kFormats) list.emplace_back(format.name);
    return list;
  }();
  return names;
}

absl::StatusOr<ImageView> ViewPixels(const GenicamPixelFormat& format, const uint8_t* data,
                                     size_t size_bytes, int width, int height,
                                     int line_padding_bytes, std::vector<uint8_t>* converted) {
  if (data == nullptr || width < 1 || height < 1 || line_padding_bytes < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("a ", format.name, " frame of ", width, " x ", height, " pixels"));
  }
  const size_t columns = static_cast<size_t>(width);
  const size_t rows = static_cast<size_t>(height);
  const size_t line_bytes = LineBytes(format, columns);
  const size_t stride = line_bytes + static_cast<size_t>(line_padding_bytes);
  if (size_bytes < stride * (rows - 1) + line_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("a ", format.name, " frame of ", width, " x ",
                                                   height, " pixels has ", stride * rows,
                                                   " bytes, but only ", size_bytes, " came"));
  }
  ImageView view{.data = data,
                 .width = width,
                 .height = height,
                 .stride_bytes = static_cast<ptrdiff_t>(stride),
                 .format = format.output()};
  if (format.zero_copy()) return view;

  const size_t out_line = columns * static_cast<size_t>(BytesPerPixel(view.format));
  const bool reduce = format.packing != k8;
  const size_t reduced_bytes = reduce ? columns * rows : 0;
  const bool colour = view.format == PixelFormat::kBgr8;
  const size_t out_bytes = colour ? out_line * rows : 0;
  converted->resize(out_bytes + reduced_bytes);
  const uint8_t* pixels = data;
  size_t pixel_stride = stride;
  if (reduce) {
    uint8_t* const reduced = converted->data() + out_bytes;
    for (size_t y = 0; y < rows; ++y) {
      ReduceLine(format, data + y * stride, width, reduced + y * columns);
    }
    pixels = reduced;
    pixel_stride = columns;
  }
  view.data = pixels;
  view.stride_bytes = static_cast<ptrdiff_t>(pixel_stride);
  if (!colour) return view;
  RIGCAL_RETURN_IF_ERROR(ToBgr(format, pixels, pixel_stride, width, height, converted->data()));
  view.data = converted->data();
  view.stride_bytes = static_cast<ptrdiff_t>(out_line);
  return view;
}

}  // namespace rigcal::agent
