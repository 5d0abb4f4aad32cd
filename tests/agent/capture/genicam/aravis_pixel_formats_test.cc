// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_pixel_formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <set>

#include "arv.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::aravis_pixel_formats_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;
using enum SampleLayout;
using enum SamplePacking;

// Written from the format's definition, sample by sample, bit by bit.
std::vector<uint8_t> Encode(SamplePacking packing, int bits, const std::vector<int>& samples) {
  std::vector<uint8_t> bytes;
  if (packing == kBits) {
    bytes.resize((samples.size() * static_cast<size_t>(bits) + 7) / 8);
    for (size_t i = 0; i < samples.size(); ++i) {
      for (int b = 0; b < bits; ++b) {
        const size_t at = i * static_cast<size_t>(bits) + static_cast<size_t>(b);
        if (samples[i] >> b & 1) bytes[at / 8] |= static_cast<uint8_t>(1 << at % 8);
      }
    }
    return bytes;
  }
  for (size_t i = 0; i < samples.size(); ++i) {
    const int value = samples[i];
    if (packing == k8) bytes.push_back(static_cast<uint8_t>(value));
    if (packing == k16) {
      bytes.push_back(static_cast<uint8_t>(value & 255));
      bytes.push_back(static_cast<uint8_t>(value >> 8));
    }
    if (packing == kPacked) {
      const int low_bits = value & ((1 << (bits - 8)) - 1);
      if (i % 2 == 0) {
        bytes.push_back(static_cast<uint8_t>(value >> (bits - 8)));
        bytes.push_back(static_cast<uint8_t>(low_bits));
      } else {
        bytes.back() = static_cast<uint8_t>(bytes.back() | low_bits << 4);
        bytes.push_back(static_cast<uint8_t>(value >> (bits - 8)));
      }
    }
  }
  return bytes;
}

// What the sensor has at a pixel: 0 red, 1 green, 2 blue.
int BayerColour(SampleLayout layout, int x, int y) {
  static const std::map<SampleLayout, std::array<int, 4>> kPatterns{{kBayerRg, {0, 1, 1, 2}},
                                                                    {kBayerGr, {1, 0, 2, 1}},
                                                                    {kBayerGb, {1, 2, 0, 1}},
                                                                    {kBayerBg, {2, 1, 1, 0}}};
  return kPatterns.at(layout)[static_cast<size_t>(y % 2 * 2 + x % 2)];
}

TEST(PixelFormats, EveryNameIsFoundByItsCodeAndOnce) {
  std::set<uint32_t> codes;
  for (const std::string& name : SupportedPixelFormats()) {
    const auto format = FindPixelFormat(std::string_view(name));
    ASSERT_TRUE(format) << name;
    const auto by_code = FindPixelFormat(format->code);
    ASSERT_TRUE(by_code) << name;
    EXPECT_EQ(by_code->name, name);
    EXPECT_TRUE(codes.insert(format->code).second) << name;
    // The size of a pixel is part of its code.
    const bool colour_samples = format->layout == kRgb || format->layout == kBgr;
    const int sample_bits = format->packing == k16       ? 16
                            : format->packing == kPacked ? 12
                                                         : format->bits;
    EXPECT_EQ(ARV_PIXEL_FORMAT_BIT_PER_PIXEL(format->code),
              static_cast<uint32_t>(colour_samples ? 24 : sample_bits))
        << name;
  }
}

TEST(PixelFormats, CodesAreThoseOfAravis) {
  const std::map<std::string, ArvPixelFormat> known{
      {"Mono8", ARV_PIXEL_FORMAT_MONO_8},
      {"Mono10", ARV_PIXEL_FORMAT_MONO_10},
      {"Mono12Packed", ARV_PIXEL_FORMAT_MONO_12_PACKED},
      {"RGB8", ARV_PIXEL_FORMAT_RGB_8_PACKED},
      {"BGR8", ARV_PIXEL_FORMAT_BGR_8_PACKED},
      {"BayerRG8", ARV_PIXEL_FORMAT_BAYER_RG_8},
      {"BayerGB10", ARV_PIXEL_FORMAT_BAYER_GB_10},
      {"BayerBG12p", ARV_PIXEL_FORMAT_BAYER_BG_12P},
      {"BayerGR10Packed", ARV_PIXEL_FORMAT_BAYER_GR_10_PACKED}};
  for (const auto& [name, code] : known) {
    EXPECT_EQ(FindPixelFormat(std::string_view(name))->code, code) << name;
  }
}

TEST(PixelFormats, UnknownOnesAreNotFound) {
  EXPECT_FALSE(FindPixelFormat(uint32_t{ARV_PIXEL_FORMAT_MONO_14}));
  EXPECT_FALSE(FindPixelFormat(uint32_t{0}));
  EXPECT_FALSE(FindPixelFormat(std::string_view("mono8")));
  EXPECT_FALSE(FindPixelFormat(std::string_view("")));
}

TEST(ViewPixels, GreyKeepsTheHighestEightBits) {
  // Odd width: the last pair of a packed line is cut.
  constexpr int kWidth = 7;
  constexpr int kHeight = 3;
  for (const std::string& name : SupportedPixelFormats()) {
    const auto format = *FindPixelFormat(std::string_view(name));
    if (format.layout != kMono) continue;
    SCOPED_TRACE(name);
    std::vector<uint8_t> data;
    std::vector<uint8_t> expected;
    for (int y = 0; y < kHeight; ++y) {
      std::vector<int> line;
      for (int x = 0; x < kWidth; ++x) {
        const int high = (37 * (y * kWidth + x) + 11) % 256;
        line.push_back((high << (format.bits - 8)) | (x % (1 << (format.bits - 8))));
        expected.push_back(static_cast<uint8_t>(high));
      }
      const std::vector<uint8_t> bytes = Encode(format.packing, format.bits, line);
      data.insert(data.end(), bytes.begin(), bytes.end());
    }
    std::vector<uint8_t> converted;
    ASSERT_OK_AND_ASSIGN(const ImageView view, ViewPixels(format, data.data(), data.size(), kWidth,
                                                          kHeight, 0, &converted));
    EXPECT_EQ(view.format, PixelFormat::kMono8);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        EXPECT_EQ(view.Row(y)[x], expected[static_cast<size_t>(y * kWidth + x)]) << x << " " << y;
      }
    }
  }
}

TEST(ViewPixels, BayerFramesGetTheirColours) {
  constexpr int kWidth = 16;
  constexpr int kHeight = 8;
  constexpr std::array<int, 3> kRedGreenBlue{200, 100, 50};
  int formats = 0;
  for (const std::string& name : SupportedPixelFormats()) {
    const auto format = *FindPixelFormat(std::string_view(name));
    if (format.layout == kMono || format.layout == kRgb || format.layout == kBgr) continue;
    SCOPED_TRACE(name);
    ++formats;
    std::vector<uint8_t> data;
    for (int y = 0; y < kHeight; ++y) {
      std::vector<int> line;
      for (int x = 0; x < kWidth; ++x) {
        const int colour = BayerColour(format.layout, x, y);
        line.push_back(kRedGreenBlue[static_cast<size_t>(colour)] << (format.bits - 8));
      }
      const std::vector<uint8_t> bytes = Encode(format.packing, format.bits, line);
      data.insert(data.end(), bytes.begin(), bytes.end());
    }
    std::vector<uint8_t> converted;
    ASSERT_OK_AND_ASSIGN(const ImageView view, ViewPixels(format, data.data(), data.size(), kWidth,
                                                          kHeight, 0, &converted));
    ASSERT_EQ(view.format, PixelFormat::kBgr8);
    for (int y = 1; y < kHeight - 1; ++y) {
      for (int x = 1; x < kWidth - 1; ++x) {
        EXPECT_THAT((std::array<int, 3>{view.Row(y)[3 * x], view.Row(y)[3 * x + 1],
                                        view.Row(y)[3 * x + 2]}),
                    ::testing::ElementsAre(50, 100, 200))
            << x << " " << y;
      }
    }
  }
  EXPECT_EQ(formats, 28);
}

TEST(ViewPixels, RedAndBlueAreExchangedForRgb) {
  const std::vector<uint8_t> rgb{10, 20, 30, 40, 50, 60, 0, 0,  // padding
                                 70, 80, 90, 15, 25, 35};
  std::vector<uint8_t> converted;
  ASSERT_OK_AND_ASSIGN(const ImageView view,
                       ViewPixels(*FindPixelFormat(std::string_view("RGB8")), rgb.data(),
                                  rgb.size(), 2, 2, 2, &converted));
  EXPECT_THAT(std::vector<int>(view.Row(0), view.Row(0) + 6),
              ::testing::ElementsAre(30, 20, 10, 60, 50, 40));
  EXPECT_THAT(std::vector<int>(view.Row(1), view.Row(1) + 6),
              ::testing::ElementsAre(90, 80, 70, 35, 25, 15));
}

TEST(ViewPixels, WhatNeedsNoConversionIsNotCopied) {
  std::vector<uint8_t> data(3 * 12 * 4);
  for (const char* name : {"Mono8", "BGR8"}) {
    std::vector<uint8_t> converted;
    ASSERT_OK_AND_ASSIGN(const ImageView view,
                         ViewPixels(*FindPixelFormat(std::string_view(name)), data.data(),
                                    data.size(), 8, 4, 1, &converted));
    EXPECT_EQ(view.data, data.data()) << name;
    EXPECT_EQ(view.stride_bytes, 8 * BytesPerPixel(view.format) + 1) << name;
    EXPECT_TRUE(converted.empty()) << name;
  }
}

TEST(ViewPixels, MemoryForConvertedFramesIsUsedAgain) {
  const auto format = *FindPixelFormat(std::string_view("BayerRG12p"));
  std::vector<uint8_t> data(64 * 32 * 2, 128);
  std::vector<uint8_t> converted;
  ASSERT_OK_AND_ASSIGN(const ImageView first,
                       ViewPixels(format, data.data(), data.size(), 64, 32, 0, &converted));
  ASSERT_OK_AND_ASSIGN(const ImageView second,
                       ViewPixels(format, data.data(), data.size(), 64, 32, 0, &converted));
  EXPECT_EQ(first.data, second.data);
}

TEST(ViewPixels, RefusesTooFewBytesForEveryFormat) {
  constexpr int kWidth = 10;
  constexpr int kHeight = 4;
  for (const std::string& name : SupportedPixelFormats()) {
    const auto format = *FindPixelFormat(std::string_view(name));
    const size_t size = kWidth * kHeight * ARV_PIXEL_FORMAT_BIT_PER_PIXEL(format.code) / 8 +
                        // Lines begin at whole bytes.
                        (format.packing == kBits ? kHeight : 0);
    std::vector<uint8_t> data(size);
    std::vector<uint8_t> converted;
    EXPECT_THAT(ViewPixels(format, data.data(), data.size(), kWidth, kHeight, 0, &converted),
                ::rigcal::testing::IsOk())
        << name;
    EXPECT_THAT(ViewPixels(format, data.data(), size - kHeight - 1, kWidth, kHeight, 0, &converted),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("bytes")))
        << name;
    EXPECT_THAT(ViewPixels(format, data.data(), 0, kWidth, kHeight, 0, &converted),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("10 x 4")))
        << name;
    EXPECT_THAT(ViewPixels(format, nullptr, data.size(), kWidth, kHeight, 0, &converted),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(name)))
        << name;
    EXPECT_THAT(ViewPixels(format, data.data(), data.size(), 0, kHeight, 0, &converted),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("0 x 4")))
        << name;
  }
}

}  // namespace
}  // namespace rigcal::agent::aravis_pixel_formats_test
