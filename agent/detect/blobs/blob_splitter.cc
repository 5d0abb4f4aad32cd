// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/blob_splitter.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr int kMaxBoxPx = 1 << 20;
constexpr double kLowLevel = 0.6, kHighLevel = 0.82;  // of the brightest pixels
constexpr int kBrightest = 6;  // that many pixels are at least as bright: one may be noise
constexpr size_t kMaxParts = 32;

uint8_t Value(const ImageView& image, int x, int y) {
  const uint8_t* pixel = image.Row(y) + x * BytesPerPixel(image.format);
  if (image.format == PixelFormat::kMono8) return pixel[0];
  return std::max({pixel[0], pixel[1], pixel[2]});
}

int BrightValue(const ImageView& image, const PixelRect& box) {
  std::array<int, 256> histogram{};
  for (int y = box.y; y < box.y + box.height; ++y) {
    for (int x = box.x; x < box.x + box.width; ++x) ++histogram[Value(image, x, y)];
  }
  int count = 0, value = 255;
  while (value > 0 && (count += histogram[static_cast<size_t>(value)]) < kBrightest) --value;
  return value;
}

}  // namespace

bool IsRound(const Blob& blob) {
  const Eigen::Matrix2d second = blob.second_moment_px2 + Eigen::Matrix2d::Identity() / 12;
  const double determinant = second.determinant(), half = 0.5 * second.trace();
  const double root = std::sqrt(std::max(0.0, half * half - determinant));
  return determinant > 0 && half + root < 1.6 * 1.6 * (half - root) &&
         blob.area_px > 0.9 * 4 * std::numbers::pi * std::sqrt(determinant);
}

Blob BlobSplitter::Flood(int start, int level) {
  Blob blob;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  int x0 = box_.width, y0 = box_.height, x1 = -1, y1 = -1;
  pending_ = {start};
  value_[static_cast<size_t>(start)] = 0;
  while (!pending_.empty()) {
    const int at = pending_.back();
    pending_.pop_back();
    const int x = at % box_.width, y = at / box_.width;
    const Eigen::Vector2d p(x, y);
    first += p;
    second += p * p.transpose();
    ++blob.area_px;
    x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
    for (int v = std::max(0, y - 1); v <= std::min(box_.height - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(box_.width - 1, x + 1); ++u) {
        uint8_t& value = value_[static_cast<size_t>(v * box_.width + u)];
        if (value < level) continue;
        value = 0;
        pending_.push_back(v * box_.width + u);
      }
    }
  }
  first /= blob.area_px;
  blob.centre_px = first + Eigen::Vector2d(box_.x, box_.y);
  blob.second_moment_px2 = second / blob.area_px - first * first.transpose();
  blob.box = {box_.x + x0, box_.y + y0, x1 - x0 + 1, y1 - y0 + 1};
  return blob;
}

void BlobSplitter::AddBright(const ImageView& image, const Blob& blob, int level, int min_area_px,
                             std::vector<Blob>* parts) {
  box_ = blob.box;
  value_.clear();
  for (int y = box_.y; y < box_.y + box_.height; ++y) {
    for (int x = box_.x; x < box_.x + box_.width; ++x) value_.push_back(Value(image, x, y));
  }
  for (size_t i = 0; i < value_.size() && parts->size() < kMaxParts; ++i) {
    if (value_[i] < level) continue;
    Blob part = Flood(static_cast<int>(i), level);
    if (part.area_px < min_area_px) continue;
    part.touches_border = part.box.x == 0 || part.box.y == 0 ||
                          part.box.x + part.box.width == image.width ||
                          part.box.y + part.box.height == image.height;
    parts->push_back(part);
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
  const int bright = BrightValue(image, blob.box);
  AddBright(image, blob, std::max(1, static_cast<int>(kLowLevel * bright)), min_area_px, &first_);
  for (const Blob& part : first_) {
    const size_t before = parts_.size();
    if (!IsRound(part)) {
      AddBright(image, part, std::max(1, static_cast<int>(kHighLevel * bright)), min_area_px,
                &parts_);
    }
    // A part that the higher level only shrinks is better known as it was.
    if (parts_.size() < before + 2) {
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
