// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/disc_finder.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr uint16_t kBeside = 3, kDiagonal = 4;  // thirds of a pixel, a chamfer distance
constexpr uint16_t kLeastPeak = 5;
constexpr int kCircleDirections = 16;
constexpr int kMostInside = 6;  // of them; a stick through the disc takes two or three
constexpr double kCircleShare = 1.3, kCirclePx = 1;
constexpr double kRimPx = 0.8;  // of the disc beyond the distance
constexpr size_t kMaxDiscs = 48;
// A hole that is filled: the end of a stick that points at the camera, in front of a sphere.
constexpr int kHolePart = 8, kMostHolePx = 400;  // of the blob's area

}  // namespace

// Borgefors' two passes.
void DiscFinder::MeasureDistances() {
  const auto nearest = [](uint16_t a, uint16_t b, uint16_t c, uint16_t d) {
    return std::min(std::min<int>(a, d) + kBeside, std::min<int>(b, c) + kDiagonal);
  };
  const int right = box_.width, bottom = box_.height;
  for (int y = 1; y <= bottom; ++y) {
    uint16_t* const row = &distance_[static_cast<size_t>(y * stride_)];
    const uint16_t* const above = row - stride_;
    for (int x = 1; x <= right; ++x) {
      if (row[x] == 0) continue;
      const int by_row = std::min(above[x] + kBeside, above[x - 1] + kDiagonal);
      row[x] = static_cast<uint16_t>(
          std::min(std::min(row[x - 1] + kBeside, above[x + 1] + kDiagonal), by_row));
    }
  }
  for (int y = bottom; y >= 1; --y) {
    uint16_t* const row = &distance_[static_cast<size_t>(y * stride_)];
    const uint16_t* const below = row + stride_;
    for (int x = right; x >= 1; --x) {
      if (row[x] == 0) continue;
      const int away = nearest(row[x + 1], below[x + 1], below[x - 1], below[x]);
      if (away < row[x]) row[x] = static_cast<uint16_t>(away);
    }
  }
}

// The first of several equal ones.
bool DiscFinder::IsPeak(int x, int y) const {
  const uint16_t own = At(x, y);
  return own > At(x - 1, y - 1) && own > At(x, y - 1) && own > At(x + 1, y - 1) &&
         own > At(x - 1, y) && own >= At(x + 1, y) && own >= At(x - 1, y + 1) &&
         own >= At(x, y + 1) && own >= At(x + 1, y + 1);
}

bool DiscFinder::IsFree(int x, int y, double radius_px) const {
  const double reach = kCircleShare * radius_px + kCirclePx;
  int inside = 0;
  for (int i = 0; i < kCircleDirections; ++i) {
    const double angle = 2 * std::numbers::pi * i / kCircleDirections;
    const int u = x + static_cast<int>(std::lround(reach * std::cos(angle)));
    const int v = y + static_cast<int>(std::lround(reach * std::sin(angle)));
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
      uint16_t* const row = &distance_[static_cast<size_t>((y - box_.y + 1) * stride_ + 1)];
      for (int x = hole.min_x - box_.x; x <= hole.max_x - box_.x; ++x) row[x] = UINT16_MAX;
    }
  }
}

const std::vector<Blob>& DiscFinder::Find(const ImageView& image, const BlobFinder& finder,
                                          const Blob& blob, int min_area_px) {
  discs_.clear();
  box_ = blob.box;
  if (box_.empty()) return discs_;
  stride_ = box_.width + 2;
  distance_.assign(static_cast<size_t>(stride_) * static_cast<size_t>(box_.height + 2), 0);
  const int first_word = box_.x / kMaskWordBits;
  const int word_count = (box_.x + box_.width - 1) / kMaskWordBits - first_word + 1;
  words_.resize(static_cast<size_t>(word_count));
  holes_.Start(word_count);
  const int last_column = box_.x + box_.width - 1;
  const uint64_t first_bits = ~uint64_t{0} << (box_.x % kMaskWordBits);
  const uint64_t last_bits = ~uint64_t{0} >> (kMaskWordBits - 1 - last_column % kMaskWordBits);
  const auto add_holes = [&](int y) {
    for (uint64_t& word : words_) word = ~word;
    words_.front() &= first_bits;
    words_.back() &= last_bits;
    holes_.AddRow(box_.y + y, first_word * kMaskWordBits, words_.data(), word_count);
  };
  for (int y = 0; y < box_.height; ++y) {
    if (!finder.MaskRow(image, box_.y + y, first_word, word_count, words_.data())) {
      std::fill(words_.begin(), words_.end(), 0);
      add_holes(y);
      continue;
    }
    uint16_t* const row = &distance_[static_cast<size_t>((y + 1) * stride_ + 1)];
    for (int x = 0; x < box_.width; ++x) {
      const int column = box_.x + x - first_word * kMaskWordBits;
      const uint64_t word = words_[static_cast<size_t>(column / kMaskWordBits)];
      row[x] = (word >> (column % kMaskWordBits) & 1) != 0 ? UINT16_MAX : 0;
    }
    add_holes(y);
  }
  FillHoles(std::min(blob.area_px / kHolePart, kMostHolePx));
  MeasureDistances();
  for (int y = 1; y <= box_.height; ++y) {
    const uint16_t* const row = &distance_[static_cast<size_t>(y * stride_)];
    for (int x = 1; x <= box_.width; ++x) {
      if (row[x] < kLeastPeak || row[x] <= row[x - 1] || !IsPeak(x, y)) continue;
      const double radius_px = At(x, y) / 3.0 - 0.5;
      Blob disc;
      if (!IsFree(x, y, radius_px) || !Cut(image, x, y, radius_px, &disc)) continue;
      if (disc.area_px < min_area_px) continue;
      discs_.push_back(disc);
      if (discs_.size() >= kMaxDiscs) return discs_;
    }
  }
  return discs_;
}

}  // namespace rigcal::agent
