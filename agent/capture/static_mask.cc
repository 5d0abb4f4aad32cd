// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/static_mask.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/image_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr int kHalfBrightness = 128;

}  // namespace

absl::StatusOr<StaticMaskLearner> StaticMaskLearner::Create(const ColourRange& colour,
                                                            const ImageSize& size_px) {
  RIGCAL_RETURN_IF_ERROR(size_px.Validate());
  RIGCAL_ASSIGN_OR_RETURN(ColourMasker masker, ColourMasker::Create(colour));
  return StaticMaskLearner(std::move(masker), size_px);
}

StaticMaskLearner::StaticMaskLearner(ColourMasker masker, const ImageSize& size_px)
    : masker_(std::move(masker)),
      width_(static_cast<int>(size_px.width)),
      height_(static_cast<int>(size_px.height)),
      taken_(static_cast<size_t>(width_) * static_cast<size_t>(height_)),
      words_(static_cast<size_t>((width_ + kMaskWordBits - 1) / kMaskWordBits)) {}

void StaticMaskLearner::Add(const ImageView& frame) {
  if (frame.width != width_ || frame.height != height_) return;
  ++frame_count_;
  for (int y = 0; y < height_; ++y) {
    uint32_t* const taken = taken_.data() + static_cast<size_t>(y) * static_cast<size_t>(width_);
    if (masker_.MaskRow(frame, y, 0, static_cast<int>(words_.size()), words_.data()) == 0) {
      continue;
    }
    for (int x = 0; x < width_; ++x) {
      const uint64_t word = words_[static_cast<size_t>(x / kMaskWordBits)];
      taken[x] += static_cast<uint32_t>(word >> (x % kMaskWordBits) & 1);
    }
  }
}

PixelMask StaticMaskLearner::Learn() const {
  PixelMask mask(width_, height_);
  const auto enough = static_cast<uint32_t>(std::max(1.0, std::ceil(kStaticShare * frame_count_)));
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      if (taken_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)] <
          enough) {
        continue;
      }
      for (int v = y - kMarginPx; v <= y + kMarginPx; ++v) {
        for (int u = x - kMarginPx; u <= x + kMarginPx; ++u) mask.Set(u, v);
      }
    }
  }
  return mask;
}

absl::StatusOr<PixelMask> ReadMask(const std::string& path, const ImageSize& size_px) {
  RIGCAL_ASSIGN_OR_RETURN(const cv::Mat image, ReadImage(path));
  if (image.cols != static_cast<int>(size_px.width) ||
      image.rows != static_cast<int>(size_px.height)) {
    return absl::InvalidArgumentError(
        absl::StrCat("the mask ", path, " is ", image.cols, "x", image.rows,
                     " pixels, but the camera's frames are ", size_px.width, "x", size_px.height,
                     "; learn it anew with rigcal-agent mask"));
  }
  PixelMask mask(image.cols, image.rows);
  for (int y = 0; y < image.rows; ++y) {
    const uchar* const row = image.ptr(y);
    for (int x = 0; x < image.cols; ++x) {
      const uchar* const pixel = row + x * image.channels();
      mask.Set(x, y, *std::max_element(pixel, pixel + image.channels()) >= kHalfBrightness);
    }
  }
  return mask;
}

absl::Status WriteMask(const PixelMask& mask, const std::string& path) {
  cv::Mat image(mask.height(), mask.width(), CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) image.at<uchar>(y, x) = mask.Get(x, y) ? 255 : 0;
  }
  try {
    if (cv::imwrite(path, image)) return absl::OkStatus();
  } catch (const cv::Exception&) {
    return absl::InvalidArgumentError(
        absl::StrCat("cannot write ", path, ": name an image file, such as mask.png"));
  }
  return absl::PermissionDeniedError(absl::StrCat("cannot write ", path));
}

}  // namespace rigcal::agent
