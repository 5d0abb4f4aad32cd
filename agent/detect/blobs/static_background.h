// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "agent/detect/blobs/colour_masker.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/detect/blobs/pixel_mask.h"
#include "common/target/colour_range.h"

namespace rigcal::agent {

// The pixels of a fixed camera that could be a marker by their colour but have not changed for some
// seconds: lamps, windows, labels, wood. Each has the grey levels that it had; a pixel belongs to
// the background only while it looks like that, so that a marker in front of a lamp is seen, and
// what has gone is ignored no longer.
//
// Learnt a few rows per frame, so that each pixel is looked at every twelfth of `after_s`, whatever
// the frame rate; of a frame at most a fixed number of pixels is looked at. The same frames give
// the same background. One thread at a time.
class StaticBackground {
 public:
  // `colour`: the widest that the detector looks for. `after_s`: how long a pixel must stay as it
  // is, above 0. INVALID_ARGUMENT: colour not valid, an image without pixels, or no time.
  static absl::StatusOr<StaticBackground> Create(const ColourRange& colour, int width, int height,
                                                 double after_s);

  // Another image is looked at from now on, of the camera's size.
  void BeginImage() { ++image_; }
  // Takes the pixels of the background out of a row of a mask, as BlobFinder::MaskRow gives them.
  void Remove(const ImageView& image, int y, int first_word, int word_count, uint64_t* words);

  // Learns from the image; frames in the order of their times. Pixels in `kept` stay as they are.
  // After a step backwards in time or a new clock epoch what is known stays.
  void Learn(const ImageView& image, int64_t time_ns, absl::Span<const PixelRect> kept);
  void Forget(const PixelRect& part);

  // The background's pixels in a part of the image, and those of them that look otherwise now.
  struct Pixels {
    int64_t count = 0, changed = 0;
  };
  Pixels Compare(const ImageView& image, const PixelRect& part) const;
  int64_t pixel_count() const { return pixel_count_; }

 private:
  StaticBackground(ColourMasker masker, int width, int height, double after_s);

  size_t Index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }
  void Resize(PixelFormat format);
  void LearnRow(const ImageView& image, int y, absl::Span<const PixelRect> kept);
  void LearnPixel(const uint8_t* pixel, int x, int y);
  bool IsAlike(const uint8_t* pixel, size_t index) const;
  uint64_t AlikeBits(const uint8_t* row, int y, int word) const;

  ColourMasker masker_;
  int width_ = 0, height_ = 0;
  int64_t step_ns_;             // between two looks at a pixel
  int bytes_ = 0;               // per pixel; 0: no image yet
  std::vector<uint8_t> grey_;   // as the pixels are
  std::vector<uint8_t> times_;  // that a pixel was found alike, less those that it was not
  PixelMask known_;             // times_ above 0
  PixelMask static_;
  int64_t pixel_count_ = 0;  // of static_
  int next_row_ = 0;
  int64_t last_ns_ = 0;
  bool has_time_ = false;
  double rows_due_ = 0;
  std::vector<uint64_t> words_;
  // Of the image that is looked at: which pixels are background, by row; made when first asked for.
  PixelMask removed_;
  std::vector<uint64_t> removed_in_;  // by row: image_ of removed_
  uint64_t image_ = 1;
};

}  // namespace rigcal::agent
