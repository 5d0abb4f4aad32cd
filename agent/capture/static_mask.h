// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/detect/blobs/colour_masker.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/detect/blobs/pixel_mask.h"
#include "common/camera/intrinsics.h"
#include "common/target/colour_range.h"

namespace rigcal::agent {

// Learns the static pixels that look like a marker: lamps, their reflections, warm-coloured things.
// Needs frames without the wand, or with a moving one: pixels in the colour range in at least
// kStaticShare of the frames are static, with a margin around them.
class StaticMaskLearner {
 public:
  static constexpr double kStaticShare = 0.25;
  static constexpr int kMarginPx = 3;  // noise moves the border of a spot

  // INVALID_ARGUMENT: the range is not valid.
  static absl::StatusOr<StaticMaskLearner> Create(const ColourRange& colour,
                                                  const ImageSize& size_px);

  // Frames of another size are ignored.
  void Add(const ImageView& frame);
  int frame_count() const { return frame_count_; }
  // Empty (no pixel set) before the first frame.
  PixelMask Learn() const;

 private:
  StaticMaskLearner(ColourMasker masker, const ImageSize& size_px);

  ColourMasker masker_;
  int width_ = 0;
  int height_ = 0;
  int frame_count_ = 0;
  std::vector<uint32_t> taken_;  // frames in which a pixel was taken, row by row
  std::vector<uint64_t> words_;
};

// A mask as an image, white where pixels are ignored: where the brightest channel is at least half
// of full scale. INVALID_ARGUMENT: its size is not `size_px`. Others as ReadImage.
absl::StatusOr<PixelMask> ReadMask(const std::string& path, const ImageSize& size_px);
absl::Status WriteMask(const PixelMask& mask, const std::string& path);

}  // namespace rigcal::agent
