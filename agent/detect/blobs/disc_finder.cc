// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/disc_finder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace rigcal::agent {
namespace {

constexpr int16_t kBeside = 3, kDiagonal = 4;  // chamfer distance to neighbours, thirds of a pixel
constexpr int16_t kFar = 16000;    // more than any distance in a box; twice it does not overflow
constexpr int16_t kLeastPeak = 5;  // thirds of a pixel, from a disc's centre to its edge
constexpr int kCircleDirections = 16;  // at which the circle around a disc is probed
constexpr int kMostInside = 6;         // directions inside of the blob; a stick takes two or three
// The circle around a disc has kCircleShare times its radius plus kCirclePx.
constexpr double kCircleShare = 1.3, kCirclePx = 1;
constexpr double kRimPx = 0.8;    // a disc's pixels lie within its radius plus this
constexpr size_t kMaxDiscs = 48;  // per blob
// Holes are filled: a stick that points at the camera leaves one in the image of its sphere.
constexpr int kHolePart = 8, kMostHolePx = 400;  // limits: part of the blob's area, and px

// A vector of eight neighbouring values.
constexpr int kEight = 8;
typedef int16_t Eight __attribute__((vector_size(16)));

Eight LoadEight(const int16_t* from) {
  Eight eight;
  std::memcpy(&eight, from, sizeof(eight));
  return eight;
}

void StoreEight(Eight eight, int16_t* to) { std::memcpy(to, &eight, sizeof(eight)); }

Eight Lesser(Eight a, Eight b) { return a < b ? a : b; }

// Raised moves each value kBy places up, Lowered kBy places down; zeros move in.
#if defined(__SSE2__)  // gcc 12 does not find these instructions
template <int kBy>
Eight Raised(Eight a) {
  return (Eight)_mm_slli_si128((__m128i)a, 2 * kBy);
}
template <int kBy>
Eight Lowered(Eight a) {
  return (Eight)_mm_srli_si128((__m128i)a, 2 * kBy);
}
#else
template <int kBy>
Eight Raised(Eight a) {
  constexpr int k = kEight - kBy;
  return __builtin_shufflevector(Eight{}, a, k, k + 1, k + 2, k + 3, k + 4, k + 5, k + 6, k + 7);
}
template <int kBy>
Eight Lowered(Eight a) {
  constexpr int k = kBy;
  return __builtin_shufflevector(a, Eight{}, k, k + 1, k + 2, k + 3, k + 4, k + 5, k + 6, k + 7);
}
#endif

bool Any(Eight truths) {
  uint64_t halves[2];
  std::memcpy(halves, &truths, sizeof(truths));
  return (halves[0] | halves[1]) != 0;
}

}  // namespace

// Borgefors' two-pass distance transform. Each pass uses the row before and the pixels before in
// the same row; a vector passes the latter on in steps of one, two and four pixels.
void DiscFinder::MeasureDistances() {
  const auto nearest = [](const int16_t* beside) {
    return Lesser(LoadEight(beside) + kBeside,
                  Lesser(LoadEight(beside - 1), LoadEight(beside + 1)) + kDiagonal);
  };
  constexpr int16_t kOne = kBeside, kTwo = 2 * kBeside, kFour = 4 * kBeside;
  // What a step adds to the values that moved; kFar where zeros moved in.
  const Eight ones = {kFar, kOne, kOne, kOne, kOne, kOne, kOne, kOne};
  const Eight twos = {kFar, kFar, kTwo, kTwo, kTwo, kTwo, kTwo, kTwo};
  const Eight fours = {kFar, kFar, kFar, kFar, kFour, kFour, kFour, kFour};
  const Eight rising = {kOne, 2 * kOne, 3 * kOne, 4 * kOne, 5 * kOne, 6 * kOne, 7 * kOne, 8 * kOne};
  for (int y = 1; y <= box_.height; ++y) {
    int16_t* const row = &distance_[static_cast<size_t>(y * stride_)];
    Eight last = {};
    for (int x = 1; x <= box_.width; x += kEight) {
      Eight d = LoadEight(row + x) & nearest(row + x - stride_);
      d = Lesser(d, Raised<1>(d) + ones);
      d = Lesser(d, Raised<2>(d) + twos);
      d = Lesser(d, Raised<4>(d) + fours);
      d = Lesser(d, last + rising);
      StoreEight(d, row + x);
      last = __builtin_shufflevector(d, d, 7, 7, 7, 7, 7, 7, 7, 7);
    }
  }
  const auto turned = [](Eight a) { return __builtin_shufflevector(a, a, 7, 6, 5, 4, 3, 2, 1, 0); };
  const Eight ones_back = turned(ones), twos_back = turned(twos), fours_back = turned(fours);
  const Eight falling = turned(rising);
  for (int y = box_.height; y >= 1; --y) {
    int16_t* const row = &distance_[static_cast<size_t>(y * stride_)];
    Eight last = {};
    for (int x = stride_ - 1 - kEight; x >= 1; x -= kEight) {
      // Pixels outside of the mask stay 0, because nothing is less.
      Eight d = Lesser(LoadEight(row + x), nearest(row + x + stride_));
      d = Lesser(d, Lowered<1>(d) + ones_back);
      d = Lesser(d, Lowered<2>(d) + twos_back);
      d = Lesser(d, Lowered<4>(d) + fours_back);
      d = Lesser(d, last + falling);
      StoreEight(d, row + x);
      last = __builtin_shufflevector(d, d, 0, 0, 0, 0, 0, 0, 0, 0);
    }
  }
}

// Of equal neighbours the first one is the peak.
bool DiscFinder::IsPeak(int x, int y) const {
  const int own = At(x, y);
  return own > At(x - 1, y - 1) && own > At(x, y - 1) && own > At(x + 1, y - 1) &&
         own > At(x - 1, y) && own >= At(x + 1, y) && own >= At(x - 1, y + 1) &&
         own >= At(x, y + 1) && own >= At(x + 1, y + 1);
}

bool DiscFinder::IsFree(int x, int y, double radius_px) const {
  static const std::array<Eigen::Vector2d, kCircleDirections> kCircle = [] {
    std::array<Eigen::Vector2d, kCircleDirections> unit;
    for (size_t i = 0; i < unit.size(); ++i) {
      const double angle = 2 * std::numbers::pi * static_cast<double>(i) / kCircleDirections;
      unit[i] = {std::cos(angle), std::sin(angle)};
    }
    return unit;
  }();
  const double reach = kCircleShare * radius_px + kCirclePx;
  int inside = 0;
  for (const Eigen::Vector2d& unit : kCircle) {
    const int u = x + static_cast<int>(std::lround(reach * unit.x()));
    const int v = y + static_cast<int>(std::lround(reach * unit.y()));
    if (u < 1 || v < 1 || u > box_.width || v > box_.height) continue;
    inside += At(u, v) > 0 ? 1 : 0;
  }
  return inside <= kMostInside;
}

bool DiscFinder::Cut(const ImageView& image, int x, int y, double radius_px, Blob* disc) const {
  const double reach = radius_px + kRimPx;
  const int steps = static_cast<int>(reach);
  ComponentSums sums;
  for (int v = std::max(1, y - steps); v <= std::min(box_.height, y + steps); ++v) {
    for (int u = std::max(1, x - steps); u <= std::min(box_.width, x + steps); ++u) {
      if (At(u, v) == 0 || (u - x) * (u - x) + (v - y) * (v - y) > reach * reach) continue;
      const int64_t at_x = box_.x + u - 1, at_y = box_.y + v - 1;
      ++sums.area;
      sums.x += at_x;
      sums.y += at_y;
      sums.xx += at_x * at_x;
      sums.xy += at_x * at_y;
      sums.yy += at_y * at_y;
      sums.min_x = std::min(sums.min_x, static_cast<int32_t>(at_x));
      sums.max_x = std::max(sums.max_x, static_cast<int32_t>(at_x));
      sums.min_y = std::min(sums.min_y, static_cast<int32_t>(at_y));
      sums.max_y = std::max(sums.max_y, static_cast<int32_t>(at_y));
    }
  }
  if (sums.area == 0) return false;
  *disc = ToBlob(sums, image);
  return true;
}

void DiscFinder::FillHoles(int most_px) {
  for (const ComponentSums& hole : holes_.Finish()) {
    if (hole.area > most_px || hole.min_x <= box_.x || hole.min_y <= box_.y ||
        hole.max_x >= box_.x + box_.width - 1 || hole.max_y >= box_.y + box_.height - 1) {
      continue;
    }
    for (int y = hole.min_y; y <= hole.max_y; ++y) {
      int16_t* const row = &distance_[static_cast<size_t>((y - box_.y + 1) * stride_ + 1)];
      std::fill(row + hole.min_x - box_.x, row + hole.max_x - box_.x + 1, int16_t{-1});
    }
  }
}

void DiscFinder::ReadMask(const ImageView& image, const BlobFinder& finder,
                          const BrightWords* bright) {
  stride_ = (box_.width + kEight - 1) / kEight * kEight + 2;
  distance_.assign(static_cast<size_t>(stride_) * static_cast<size_t>(box_.height + 2), 0);
  const int first_word = box_.x / kMaskWordBits, first_bit = box_.x % kMaskWordBits;
  const int word_count = (box_.x + box_.width - 1) / kMaskWordBits - first_word + 1;
  words_.resize(static_cast<size_t>(word_count) + 1);
  holes_.Start(word_count);
  const int last_column = box_.x + box_.width - 1;
  const uint64_t first_bits = ~uint64_t{0} << first_bit;
  const uint64_t last_bits = ~uint64_t{0} >> (kMaskWordBits - 1 - last_column % kMaskWordBits);
  const Eight bits = {1, 2, 4, 8, 16, 32, 64, 128};
  for (int y = 0; y < box_.height; ++y) {
    if (!finder.MaskRow(image, box_.y + y, first_word, word_count, words_.data(), bright)) {
      std::fill(words_.begin(), words_.end(), 0);
    }
    words_[static_cast<size_t>(word_count) - 1] &= last_bits;
    words_[static_cast<size_t>(word_count)] = 0;
    int16_t* const row = &distance_[static_cast<size_t>((y + 1) * stride_ + 1)];
    for (int x = 0; x < box_.width; x += kEight) {
      const int at = first_bit + x, shift = at % kMaskWordBits;
      const uint64_t* const word = &words_[static_cast<size_t>(at / kMaskWordBits)];
      uint64_t eight = word[0] >> shift;
      if (shift > kMaskWordBits - kEight) eight |= word[1] << (kMaskWordBits - shift);
      if ((eight & 255) == 0) continue;
      StoreEight((Eight)(((Eight{} + static_cast<int16_t>(eight & 255)) & bits) != 0), row + x);
    }
    for (uint64_t& word : words_) word = ~word;
    words_.front() &= first_bits;
    words_[static_cast<size_t>(word_count) - 1] &= last_bits;
    holes_.AddRow(box_.y + y, first_word * kMaskWordBits, words_.data(), word_count);
  }
}

const std::vector<Blob>& DiscFinder::Find(const ImageView& image, const BlobFinder& finder,
                                          const Blob& blob, int min_area_px,
                                          const BrightWords* bright) {
  discs_.clear();
  box_ = blob.box;
  if (box_.empty()) return discs_;
  ReadMask(image, finder, bright);
  FillHoles(std::min(blob.area_px / kHolePart, kMostHolePx));
  MeasureDistances();
  for (int y = 1; y <= box_.height; ++y) {
    const int16_t* const row = &distance_[static_cast<size_t>(y * stride_)];
    for (int first = 1; first <= box_.width; first += kEight) {
      const int16_t* const at = row + first;
      const Eight own = LoadEight(at);
      if (!Any((own > LoadEight(at - 1)) & (own >= LoadEight(at + 1)) &
               (own > LoadEight(at - stride_)) & (own >= LoadEight(at + stride_)))) {
        continue;
      }
      for (int x = first; x < std::min(first + kEight, box_.width + 1); ++x) {
        if (row[x] < kLeastPeak || !IsPeak(x, y)) continue;
        const double radius_px = At(x, y) / 3.0 - 0.5;
        Blob disc;
        if (!IsFree(x, y, radius_px) || !Cut(image, x, y, radius_px, &disc)) continue;
        if (disc.area_px < min_area_px) continue;
        discs_.push_back(disc);
        if (discs_.size() >= kMaxDiscs) return discs_;
      }
    }
  }
  return discs_;
}

}  // namespace rigcal::agent
