// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/contrast_masker.h"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <numbers>

#include "agent/detect/blobs/contrast_rows.h"
#include "agent/detect/blobs/value_rows.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

// On each side of a block (SumsOf17): a sphere of up to 10 px is less than half of what is around.
constexpr int kAroundBlocks = 8;
// Than the mean, and in sigmas of a block's noise.
constexpr double kLeastMoreGrey = 3, kMostMoreGrey = 8, kMoreNoises = 3;
constexpr int kSampleStepPx = 32;  // of the noise
constexpr int kPixelsOfBlock = 4;

// Each bit of the lower half twice.
uint64_t Doubled(uint64_t bits) {
  bits &= 0xffffffff;
  bits = (bits | bits << 16) & 0x0000ffff0000ffff;
  bits = (bits | bits << 8) & 0x00ff00ff00ff00ff;
  bits = (bits | bits << 4) & 0x0f0f0f0f0f0f0f0f;
  bits = (bits | bits << 2) & 0x3333333333333333;
  bits = (bits | bits << 1) & 0x5555555555555555;
  return bits | bits << 1;
}

// What the means of a part's blocks need, from a whole word and an even row on, so that the blocks
// are those of the whole image; inside the image.
PixelRect WithSurroundings(const PixelRect& part, const ImageView& image) {
  constexpr int kAroundPx = 2 * kAroundBlocks + 1;
  const int left = std::max(0, part.x - kAroundPx) / kMaskWordBits * kMaskWordBits;
  const int top = std::max(0, part.y - kAroundPx) / 2 * 2;
  const int right = std::min(image.width, (part.x + part.width + kAroundPx + 1) / 2 * 2);
  const int bottom = std::min(image.height, (part.y + part.height + kAroundPx + 1) / 2 * 2);
  return {left, top, std::max(0, right - left), std::max(0, bottom - top)};
}

}  // namespace

void ContrastMasker::ReadBlocks(const ImageView& image, const PixelRect& part) {
  const int bytes = BytesPerPixel(image.format);
  const auto pixels = static_cast<size_t>(2 * width_);
  upper_.resize(pixels);
  lower_.resize(pixels);
  blocks_.resize(static_cast<size_t>(width_) * static_cast<size_t>(height_));
  const auto read = [&](int y, std::vector<int16_t>* row) {
    const uint8_t* const from = image.Row(y) + part.x * bytes;
    if (bytes == 1) {
      Widened(from, pixels, row->data());
    } else {
      ChannelDifference(from, strongest_, weakest_, pixels, row->data());
    }
  };
  for (int row = 0; row < height_; ++row) {
    read(part.y + 2 * row, &upper_);
    read(part.y + 2 * row + 1, &lower_);
    BlockSums(upper_.data(), lower_.data(), static_cast<size_t>(width_),
              blocks_.data() + static_cast<ptrdiff_t>(row) * width_);
  }
}

// Neighbouring blocks differ by it, hardly ever by more than what is seen there.
double ContrastMasker::BlockNoise(const ImageView& image) {
  const int bytes = BytesPerPixel(image.format);
  const auto block_at = [&](int x, int y) {
    int sum = 0;
    for (int i = 0; i < kPixelsOfBlock; ++i) {
      const uint8_t* const pixel = image.Row(y + i / 2) + (x + i % 2) * bytes;
      sum += bytes == 1 ? pixel[0] : pixel[strongest_] - pixel[weakest_];
    }
    return sum;
  };
  steps_.clear();
  for (int y = 0; y + 2 <= image.height; y += kSampleStepPx) {
    for (int x = 0; x + 4 <= image.width; x += kSampleStepPx) {
      steps_.push_back(std::abs(block_at(x, y) - block_at(x + 2, y)));
    }
  }
  if (steps_.empty()) return 0;
  const auto middle = steps_.begin() + static_cast<ptrdiff_t>(steps_.size() / 2);
  std::nth_element(steps_.begin(), middle, steps_.end());
  return kSigmaOverMad / std::numbers::sqrt2 * (*middle + 0.5);
}

void ContrastMasker::MarkRow(int row, int more, uint8_t* marked) {
  const auto width = static_cast<size_t>(width_);
  SumsOf17(columns_.data(), width, sums_.data());
  const int rows =
      std::min(row + kAroundBlocks, height_ - 1) - std::max(row - kAroundBlocks, 0) + 1;
  MoreThanMean(blocks_.data() + static_cast<ptrdiff_t>(row) * width_, sums_.data(), counts_.data(),
               rows, more, width, marked);
}

void ContrastMasker::WriteRow(const uint8_t* above, const uint8_t* middle, const uint8_t* below,
                              int x, int y) {
  const auto width = static_cast<size_t>(width_);
  MostOfNine(above, middle, below, width, sums_of_three_.data(), most_.data());
  BitsAtLeast(most_.data(), width, 1, words_.data());
  const int first = x / kMaskWordBits, last = (x + 2 * width_ - 1) / kMaskWordBits;
  for (const int at : {y, y + 1}) {
    uint64_t* const to = mask_.MutableRow(at);
    for (int i = first; i <= last; ++i) {
      const int half = i - first;
      to[i] = Doubled(words_[static_cast<size_t>(half / 2)] >> (half % 2 == 0 ? 0 : 32));
    }
  }
}

const PixelMask& ContrastMasker::Mask(const ImageView& image, const PixelRect& part) {
  if (mask_.width() != image.width || mask_.height() != image.height) {
    mask_ = PixelMask(image.width, image.height);
  }
  const PixelRect whole = WithSurroundings(part, image);
  width_ = whole.width / 2;
  height_ = whole.height / 2;
  for (int y = whole.y; y < whole.y + whole.height; ++y) {
    std::fill_n(mask_.MutableRow(y), mask_.words_per_row(), uint64_t{0});
  }
  if (width_ < 1 || height_ < 1) return mask_;
  ReadBlocks(image, whole);
  const auto width = static_cast<size_t>(width_);
  columns_.assign(width + 2 * kAroundBlocks, 0);
  sums_.resize(width + 2 * kAroundBlocks);
  for (auto& marked : marked_) marked.assign(width, 0);
  most_.resize(width);
  sums_of_three_.resize(width + 2);
  words_.assign(width / kMaskWordBits + 1, 0);
  counts_.resize(width);
  for (int i = 0; i < width_; ++i) {
    counts_[static_cast<size_t>(i)] =
        std::min(i + kAroundBlocks, width_ - 1) - std::max(i - kAroundBlocks, 0) + 1;
  }
  const auto row_at = [&](int row) {
    return blocks_.data() + static_cast<ptrdiff_t>(row) * width_;
  };
  int32_t* const columns = columns_.data() + kAroundBlocks;
  const auto more =
      static_cast<int>(std::clamp(kMoreNoises * BlockNoise(image), kPixelsOfBlock * kLeastMoreGrey,
                                  kPixelsOfBlock * kMostMoreGrey));
  const auto marked_at = [&](int row) {
    return marked_[static_cast<size_t>((row + 3) % 3)].data();
  };
  for (int row = -kAroundBlocks; row < height_; ++row) {
    if (row + kAroundBlocks < height_) AddRow(row_at(row + kAroundBlocks), width, columns);
    if (row - kAroundBlocks > 0) SubtractRow(row_at(row - kAroundBlocks - 1), width, columns);
    if (row < 0) continue;
    MarkRow(row, more, marked_at(row));
    if (row > 0) {
      WriteRow(marked_at(row - 2), marked_at(row - 1), marked_at(row), whole.x,
               whole.y + 2 * (row - 1));
    }
  }
  std::fill_n(marked_at(height_), width, uint8_t{0});
  WriteRow(marked_at(height_ - 2), marked_at(height_ - 1), marked_at(height_), whole.x,
           whole.y + 2 * (height_ - 1));
  return mask_;
}

}  // namespace rigcal::agent
