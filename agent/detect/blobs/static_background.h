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

// Learns which pixels of a fixed camera have the wand's colour but do not change for some seconds:
// lamps, windows, labels, wood. It keeps their grey levels. A pixel belongs to the background only
// while it looks like that, so a marker in front of a lamp is seen, and what has gone is no longer
// ignored.
//
// It learns a few rows per frame and looks at each pixel every twelfth of `after_s`, whatever the
// frame rate, but at no more than a fixed number of pixels per frame. The same frames give the same
// background. One thread at a time.
class StaticBackground {
 public:
  // `colour`: the widest that the detector looks for. `after_s`, above 0: how long a pixel must
  // stay as it is. INVALID_ARGUMENT: an invalid colour, an image without pixels, or no time.
  static absl::StatusOr<StaticBackground> Create(const ColourRange& colour, int width, int height,
                                                 double after_s);

  // Announces another image, which has the camera's size.
  void BeginImage() { ++image_; }
  // Takes the pixels of the background out of a mask row as BlobFinder::MaskRow writes it.
  void Remove(const ImageView& image, int y, int first_word, int word_count, uint64_t* words);

  // Learns from an image; images come in the order of their times. Pixels in `kept` stay as they
  // are. A step backwards in time or a new clock epoch changes nothing of what is known.
  void Learn(const ImageView& image, int64_t time_ns, absl::Span<const PixelRect> kept);
  void Forget(const PixelRect& part);

  // Counts the background's pixels in a part of the image, and those that look different now.
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
  int bytes_ = 0;               // per pixel: 3 until a grey image comes
  std::vector<uint8_t> grey_;   // as learnt, in the layout of the image
  std::vector<uint8_t> times_;  // looks that found the pixel alike, less those that did not
  PixelMask known_;             // times_ above 0
  PixelMask static_;            // times_ at least kLooks
  int64_t pixel_count_ = 0;     // in static_
  int next_row_ = 0;
  int64_t last_ns_ = 0;
  bool has_time_ = false;
  double rows_due_ = 0;
  std::vector<uint64_t> words_;
  // The background's pixels in the current image; a row is computed when it is first asked for.
  PixelMask removed_;
  std::vector<uint64_t> removed_in_;  // by row: the image_ for which removed_ holds
  uint64_t image_ = 1;
};

}  // namespace rigcal::agent
