// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "agent/detect/blobs/image_view.h"
#include "agent/detect/blobs/integer_colour_range.h"
#include "common/target/colour_range.h"

namespace rigcal::agent {

// Hue of a pixel in degrees, 0 without chroma.
inline double HueDeg(int b, int g, int r) {
  const int value = std::max({b, g, r});
  const int chroma = value - std::min({b, g, r});
  if (chroma == 0) return 0;
  if (value == r) return 60.0 * (g >= b ? g - b : 6 * chroma + g - b) / chroma;
  if (value == g) return 60.0 * (2 * chroma + b - r) / chroma;
  return 60.0 * (4 * chroma + r - g) / chroma;
}

inline bool HueInRange(const ColourRange& range, double hue_deg) {
  if (range.hue_min_deg <= range.hue_max_deg) {
    if (hue_deg == 0 && range.hue_max_deg == 360) return true;
    return hue_deg >= range.hue_min_deg && hue_deg <= range.hue_max_deg;
  }
  return hue_deg >= range.hue_min_deg || hue_deg <= range.hue_max_deg;
}

// The definition of ColourRange in double precision.
inline bool InRange(const ColourRange& range, int b, int g, int r) {
  const int value = std::max({b, g, r});
  const int smallest = std::min({b, g, r});
  if (value < range.value_min) return false;
  if (smallest >= range.washed_out_min) return true;
  const double saturation = static_cast<double>(value - smallest) / value;
  return saturation >= range.saturation_min && HueInRange(range, HueDeg(b, g, r));
}

inline bool Holds(const HueHalfPlane& plane, const uint8_t bgr[3]) {
  const int slope_by = (bgr[plane.slope_plus] - bgr[plane.slope_minus]) * plane.slope;
  return bgr[plane.plus] - bgr[plane.minus] > (slope_by >> 16);
}

// The definition of IntegerColourRange for one pixel.
inline bool Takes(const IntegerColourRange& range, const uint8_t bgr[3]) {
  const uint8_t value = std::max({bgr[0], bgr[1], bgr[2]});
  const uint8_t smallest = std::min({bgr[0], bgr[1], bgr[2]});
  if (value <= range.value_below) return false;
  if (smallest > range.washed_out_below) return true;
  if (smallest == value) return range.takes_grey;
  if (smallest > (value * range.grey_share >> 16)) return false;
  return (Holds(range.from, bgr) && Holds(range.to, bgr)) != range.outside;
}

inline ColourRange Hues(double from_deg, double to_deg) {
  ColourRange range;
  range.hue_min_deg = from_deg;
  range.hue_max_deg = to_deg;
  return range;
}

// Ranges with limits on, beside and far from hues that pixels can have.
inline std::vector<ColourRange> ManyRanges() {
  std::vector<ColourRange> ranges;
  for (const auto& [from, to] : std::vector<std::pair<double, double>>{
           {0, 50},       {340, 20},     {0, 360},     {360, 0},     {0, 0},       {360, 360},
           {50, 50},      {30, 30},      {30, 210},    {210, 30},    {0, 180},     {180, 360},
           {60, 120},     {120, 60},     {59.9, 60},   {60, 59.999}, {50, 49.999}, {12.3, 12.3},
           {12.3, 192.3}, {192.2, 12.3}, {0.2, 0.3},   {359.9, 0.1}, {300, 360},   {270, 90},
           {90, 269.9},   {1e-9, 360},   {0, 359.999}, {0, 0.24},    {359.76, 360}}) {
    ranges.push_back(Hues(from, to));
  }
  std::mt19937 random(7);
  std::uniform_real_distribution<double> hue(0, 360);
  std::uniform_real_distribution<double> share(0, 1);
  std::uniform_int_distribution<int> level(1, 255);
  for (int i = 0; i < 60; ++i) {
    ColourRange range = Hues(hue(random), hue(random));
    range.saturation_min = share(random);
    range.value_min = level(random);
    range.washed_out_min = level(random) + 1;
    ranges.push_back(range);
  }
  for (const double saturation : {0.0, 1.0, 0.5, 1.0 / 3, 1e-12, 0.9999}) {
    for (ColourRange range : {Hues(0, 50), Hues(100, 200), Hues(300, 200), Hues(300, 360)}) {
      range.saturation_min = saturation;
      range.value_min = saturation == 0.5 ? 1 : 60;
      range.washed_out_min = 256;
      ranges.push_back(range);
    }
  }
  return ranges;
}

// An image with its own pixels. Its buffer ends with the last pixel of the last row.
struct Image {
  Image(int width_px, int height_px, PixelFormat pixel_format = PixelFormat::kBgr8,
        int padding_bytes = 0)
      : width(width_px),
        height(height_px),
        format(pixel_format),
        stride(width * BytesPerPixel(format) + padding_bytes),
        bytes(static_cast<size_t>(stride * height - padding_bytes)) {}

  ImageView View() const { return {bytes.data(), width, height, stride, format}; }
  uint8_t* Pixel(int x, int y) { return bytes.data() + y * stride + x * BytesPerPixel(format); }
  bool InRange(const ColourRange& range, int x, int y) const {
    const uint8_t* pixel = View().Row(y) + x * BytesPerPixel(format);
    if (format == PixelFormat::kMono8) return pixel[0] >= range.value_min;
    return agent::InRange(range, pixel[0], pixel[1], pixel[2]);
  }

  int width;
  int height;
  PixelFormat format;
  int stride;
  std::vector<uint8_t> bytes;
};

// `bright_share` of the pixels are of any colour, the others darker than any usual range takes.
inline void FillRandomly(uint32_t seed, double bright_share, Image* image) {
  std::mt19937 random(seed);
  std::bernoulli_distribution bright(bright_share);
  std::uniform_int_distribution<int> any(0, 255);
  std::uniform_int_distribution<int> dark(0, 50);
  const int channels = BytesPerPixel(image->format);
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      auto& level = bright(random) ? any : dark;
      for (int c = 0; c < channels; ++c) {
        image->Pixel(x, y)[c] = static_cast<uint8_t>(level(random));
      }
    }
  }
}

}  // namespace rigcal::agent
