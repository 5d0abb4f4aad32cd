// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/static_background.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr int kLooks = 12;      // looks that find a pixel alike make it background
constexpr int kMostLooks = 18;  // limit: a change must last six looks before a pixel is learnt anew
constexpr int kUnlike = 3;      // looks that one without likeness takes away
// A pixel has not changed if it differs by at most kTolerance grey levels plus 1 /
// 2^kToleranceShift (6 %) of its level: noise, and lamps that flicker.
constexpr int kTolerance = 12, kToleranceShift = 4;
constexpr int64_t kMaxPixels = 60000;  // pixels learnt per frame, up to the end of a row

bool IsAlikeGrey(int grey, int known) {
  return std::abs(grey - known) <= kTolerance + (known >> kToleranceShift);
}

}  // namespace

absl::StatusOr<StaticBackground> StaticBackground::Create(const ColourRange& colour, int width,
                                                          int height, double after_s) {
  RIGCAL_ASSIGN_OR_RETURN(ColourMasker masker, ColourMasker::Create(colour));
  if (width <= 0 || height <= 0 || !(after_s > 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat("a background needs pixels and a time above 0 s, not ", width, "x", height,
                     " and ", after_s, " s"));
  }
  return StaticBackground(std::move(masker), width, height, after_s);
}

StaticBackground::StaticBackground(ColourMasker masker, int width, int height, double after_s)
    : masker_(std::move(masker)),
      width_(width),
      height_(height),
      step_ns_(std::max<int64_t>(1, std::llround(1e9 * after_s / kLooks))) {
  Resize(PixelFormat::kBgr8);
}

void StaticBackground::Resize(PixelFormat format) {
  bytes_ = BytesPerPixel(format);
  const size_t pixels = static_cast<size_t>(width_) * static_cast<size_t>(height_);
  grey_.assign(pixels * static_cast<size_t>(bytes_), 0);
  times_.assign(pixels, 0);
  known_ = static_ = removed_ = PixelMask(width_, height_);
  removed_in_.assign(static_cast<size_t>(height_), 0);
  words_.assign(static_cast<size_t>(known_.words_per_row()), 0);
  pixel_count_ = 0;
}

bool StaticBackground::IsAlike(const uint8_t* pixel, size_t index) const {
  const uint8_t* const known = &grey_[index * static_cast<size_t>(bytes_)];
  for (int k = 0; k < bytes_; ++k) {
    if (!IsAlikeGrey(pixel[k], known[k])) return false;
  }
  return true;
}

// Returns the static pixels of a word that look as they were learnt.
uint64_t StaticBackground::AlikeBits(const uint8_t* row, int y, int word) const {
  uint64_t alike = 0;
  for (uint64_t left = static_.Row(y)[word]; left != 0; left &= left - 1) {
    const int x = word * kMaskWordBits + std::countr_zero(left);
    if (IsAlike(row + x * bytes_, Index(x, y))) alike |= left & (~left + 1);
  }
  return alike;
}

void StaticBackground::Remove(const ImageView& image, int y, int first_word, int word_count,
                              uint64_t* words) {
  if (pixel_count_ == 0 || BytesPerPixel(image.format) != bytes_ || y >= height_) return;
  const auto row = static_cast<size_t>(y);
  if (removed_in_[row] != image_) {
    removed_in_[row] = image_;
    for (int i = 0; i < removed_.words_per_row(); ++i) {
      removed_.MutableRow(y)[i] = static_.Row(y)[i] == 0 ? 0 : AlikeBits(image.Row(y), y, i);
    }
  }
  const int count = std::min(word_count, removed_.words_per_row() - first_word);
  for (int i = 0; i < count; ++i) words[i] &= ~removed_.Row(y)[first_word + i];
}

void StaticBackground::LearnPixel(const uint8_t* pixel, int x, int y) {
  const size_t index = Index(x, y);
  uint8_t& times = times_[index];
  uint8_t* const known = &grey_[index * static_cast<size_t>(bytes_)];
  if (times == 0) {
    std::copy_n(pixel, bytes_, known);
    times = 1;
    known_.Set(x, y);
    return;
  }
  const bool was_static = times >= kLooks;
  if (IsAlike(pixel, index)) {
    times = static_cast<uint8_t>(std::min(kMostLooks, times + 1));
    // Follows slow changes, and removes the noise of the first look.
    for (int k = 0; k < bytes_; ++k) {
      known[k] = static_cast<uint8_t>(known[k] + (pixel[k] > known[k] ? 1 : 0) -
                                      (pixel[k] < known[k] ? 1 : 0));
    }
  } else {
    times = static_cast<uint8_t>(std::max(0, times - kUnlike));
    if (times == 0) known_.Set(x, y, false);
  }
  const bool is_static = times >= kLooks;
  if (is_static == was_static) return;
  static_.Set(x, y, is_static);
  pixel_count_ += is_static ? 1 : -1;
}

void StaticBackground::LearnRow(const ImageView& image, int y, absl::Span<const PixelRect> kept) {
  const int word_count = known_.words_per_row();
  masker_.MaskRow(image, y, 0, word_count, words_.data());
  for (int i = 0; i < word_count; ++i) words_[static_cast<size_t>(i)] |= known_.Row(y)[i];
  for (const PixelRect& part : kept) {
    if (y < part.y || y >= part.y + part.height) continue;
    for (int x = std::max(0, part.x); x < std::min(width_, part.x + part.width); ++x) {
      words_[static_cast<size_t>(x / kMaskWordBits)] &= ~(uint64_t{1} << (x % kMaskWordBits));
    }
  }
  const uint8_t* const row = image.Row(y);
  for (int i = 0; i < word_count; ++i) {
    for (uint64_t left = words_[static_cast<size_t>(i)]; left != 0; left &= left - 1) {
      const int x = i * kMaskWordBits + std::countr_zero(left);
      LearnPixel(row + x * bytes_, x, y);
    }
  }
}

void StaticBackground::Learn(const ImageView& image, int64_t time_ns,
                             absl::Span<const PixelRect> kept) {
  if (image.width != width_ || image.height != height_) return;
  if (BytesPerPixel(image.format) != bytes_) Resize(image.format);
  const int64_t passed_ns = has_time_ ? time_ns - last_ns_ : 0;
  last_ns_ = time_ns;
  has_time_ = true;
  if (passed_ns <= 0) return;
  // No row is due more than once.
  rows_due_ = std::min<double>(height_, rows_due_ + static_cast<double>(passed_ns) /
                                                        static_cast<double>(step_ns_) * height_);
  int64_t pixels_left = kMaxPixels;
  for (; rows_due_ >= 1 && pixels_left > 0; rows_due_ -= 1) {
    LearnRow(image, next_row_, kept);
    for (const uint64_t word : words_) pixels_left -= std::popcount(word);
    next_row_ = (next_row_ + 1) % height_;
  }
}

void StaticBackground::Forget(const PixelRect& part) {
  if (bytes_ == 0) return;
  for (int y = std::max(0, part.y); y < std::min(height_, part.y + part.height); ++y) {
    for (int x = std::max(0, part.x); x < std::min(width_, part.x + part.width); ++x) {
      times_[Index(x, y)] = 0;
      pixel_count_ -= static_.Get(x, y) ? 1 : 0;
      known_.Set(x, y, false);
      static_.Set(x, y, false);
    }
  }
  ++image_;
}

StaticBackground::Pixels StaticBackground::Compare(const ImageView& image,
                                                   const PixelRect& part) const {
  Pixels pixels;
  if (BytesPerPixel(image.format) != bytes_) return pixels;
  for (int y = std::max(0, part.y); y < std::min(height_, part.y + part.height); ++y) {
    for (int x = std::max(0, part.x); x < std::min(width_, part.x + part.width); ++x) {
      if (!static_.Get(x, y)) continue;
      ++pixels.count;
      pixels.changed += IsAlike(image.Row(y) + x * bytes_, Index(x, y)) ? 0 : 1;
    }
  }
  return pixels;
}

}  // namespace rigcal::agent
