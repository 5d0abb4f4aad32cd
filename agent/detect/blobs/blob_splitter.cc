// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/blob_splitter.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "agent/detect/blobs/value_rows.h"

namespace rigcal::agent {
namespace {

constexpr int kMaxBoxPx = 1 << 20;
constexpr double kLowLevel = 0.6, kHighLevel = 0.82;  // of the brightest pixels
constexpr size_t kBrightest = 6;  // that many pixels are at least as bright: one may be noise
constexpr int kAlike = 12;        // grey levels
constexpr size_t kMaxParts = 32;
constexpr int kClipped = 250;
constexpr int kMuchSmaller = 3;

}  // namespace

bool IsRound(const Blob& blob) {
  const Eigen::Matrix2d second = blob.second_moment_px2 + Eigen::Matrix2d::Identity() / 12;
  const double determinant = second.determinant(), half = 0.5 * second.trace();
  const double root = std::sqrt(std::max(0.0, half * half - determinant));
  return determinant > 0 && half + root < 1.6 * 1.6 * (half - root) &&
         blob.area_px > 0.9 * 4 * std::numbers::pi * std::sqrt(determinant);
}

// The largest channels of the box, or the means of all, row by row.
void BlobSplitter::ReadValues(const ImageView& image, const PixelRect& box, bool means) {
  box_ = box;
  const auto width = static_cast<size_t>(box.width);
  value_.resize(width * static_cast<size_t>(box.height));
  uint8_t* out = value_.data();
  for (int y = box.y; y < box.y + box.height; ++y, out += width) {
    const uint8_t* pixel = image.Row(y) + box.x * BytesPerPixel(image.format);
    if (image.format == PixelFormat::kMono8) {
      std::copy_n(pixel, width, out);
      continue;
    }
    if (means) {
      MeanChannels(pixel, width, out);
    } else {
      LargestChannels(pixel, width, out);
    }
  }
}

int BlobSplitter::BrightValue() const {
  // Mostly the brightest are alike.
  const int largest = LargestOf(value_.data(), value_.size());
  for (int value = largest; value > std::max(0, largest - kAlike); --value) {
    const size_t count = CountAtLeast(value_.data(), value_.size(), static_cast<uint8_t>(value));
    if (count >= kBrightest) return value;
  }
  std::array<size_t, 256> histogram{};
  for (const uint8_t value : value_) ++histogram[value];
  size_t count = 0;
  int value = 255;
  while (value > 0 && (count += histogram[static_cast<size_t>(value)]) < kBrightest) --value;
  return value;
}

// The connected pixels of `part`, inside the box, that are at least as bright as `level`.
void BlobSplitter::AddBright(const ImageView& image, const PixelRect& part, int level,
                             int min_area_px, std::vector<Blob>* parts) {
  const int word_count = (part.width + kMaskWordBits - 1) / kMaskWordBits;
  words_.resize(static_cast<size_t>(word_count));
  labeller_.Start(word_count);
  for (int y = part.y; y < part.y + part.height; ++y) {
    const uint8_t* value = value_.data() +
                           static_cast<size_t>(y - box_.y) * static_cast<size_t>(box_.width) +
                           static_cast<size_t>(part.x - box_.x);
    BitsAtLeast(value, static_cast<size_t>(part.width), static_cast<uint8_t>(level), words_.data());
    labeller_.AddRow(y, part.x, words_.data(), word_count);
  }
  for (const ComponentSums& sums : labeller_.Finish()) {
    if (parts->size() >= kMaxParts) return;
    if (sums.area >= min_area_px) parts->push_back(ToBlob(sums, image));
  }
}

const std::vector<Blob>& BlobSplitter::Split(const ImageView& image, const Blob& blob,
                                             int min_area_px) {
  parts_.clear();
  first_.clear();
  if (blob.box.empty() || blob.box.width > kMaxBoxPx / blob.box.height) {
    parts_.push_back(blob);
    return parts_;
  }
  ReadValues(image, blob.box, false);
  int bright = BrightValue();
  // Clipping hides which is brighter, but in the other channels.
  if (bright >= kClipped && image.format == PixelFormat::kBgr8) {
    ReadValues(image, blob.box, true);
    bright = BrightValue();
  }
  AddBright(image, blob.box, std::max(1, static_cast<int>(kLowLevel * bright)), min_area_px,
            &first_);
  for (const Blob& part : first_) {
    const size_t before = parts_.size();
    if (!IsRound(part)) {
      AddBright(image, part.box, std::max(1, static_cast<int>(kHighLevel * bright)), min_area_px,
                &parts_);
    }
    // A part that the higher level only shrinks is better known as it was.
    if (parts_.size() == before ||
        (parts_.size() == before + 1 && kMuchSmaller * parts_[before].area_px > part.area_px)) {
      parts_.resize(before);
      parts_.push_back(part);
    }
  }
  // A box holds pieces of its neighbours too.
  std::stable_sort(parts_.begin(), parts_.end(),
                   [](const Blob& a, const Blob& b) { return a.area_px > b.area_px; });
  const auto known = [](const Blob& a, const Blob& b) {
    return (a.centre_px - b.centre_px).squaredNorm() * std::numbers::pi < a.area_px;
  };
  for (size_t i = 0; i < parts_.size(); ++i) {
    const auto begin = parts_.begin() + static_cast<ptrdiff_t>(i);
    const Blob kept = *begin;
    parts_.erase(std::remove_if(begin + 1, parts_.end(),
                                [&](const Blob& part) { return known(kept, part); }),
                 parts_.end());
  }
  if (parts_.empty()) parts_.push_back(blob);
  return parts_;
}

}  // namespace rigcal::agent
