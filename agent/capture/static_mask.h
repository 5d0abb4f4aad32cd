// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/detect/blobs/colour_masker.h"
#include "agent/detect/blobs/colour_range.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/detect/blobs/pixel_mask.h"
#include "common/camera/intrinsics.h"

namespace rigcal::agent {

// Learns what in front of a camera looks like a marker but stands still: lamps, their reflections,
// warm-coloured things. From pictures without the wand, or with one that is moved: what the colour
// range takes in at least kStaticShare of the pictures is static, and so is what lies around it.
class StaticMaskLearner {
 public:
  static constexpr double kStaticShare = 0.25;
  static constexpr int kMarginPx = 3;  // noise moves the border of a spot

  // INVALID_ARGUMENT: the range is not valid.
  static absl::StatusOr<StaticMaskLearner> Create(const ColourRange& colour,
                                                  const ImageSize& size_px);

  // Pictures of another size are left out.
  void Add(const ImageView& picture);
  int picture_count() const { return picture_count_; }
  // Empty (no pixel set) before the first picture.
  PixelMask Learn() const;

 private:
  StaticMaskLearner(ColourMasker masker, const ImageSize& size_px);

  ColourMasker masker_;
  int width_ = 0;
  int height_ = 0;
  int picture_count_ = 0;
  std::vector<uint32_t> taken_;  // pictures in which a pixel was taken, row by row
  std::vector<uint64_t> words_;
};

// A mask as a picture, white where pixels are ignored. ReadMask takes every picture and looks at
// its brightest channel, from half of the brightness on.
// INVALID_ARGUMENT: its size is not `size_px`. Others as ReadImage.
absl::StatusOr<PixelMask> ReadMask(const std::string& path, const ImageSize& size_px);
absl::Status WriteMask(const PixelMask& mask, const std::string& path);

}  // namespace rigcal::agent
