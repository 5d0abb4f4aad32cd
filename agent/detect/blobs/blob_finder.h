// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "agent/detect/blobs/bright_words.h"
#include "agent/detect/blobs/colour_masker.h"
#include "agent/detect/blobs/run_labeller.h"
#include "agent/detect/blobs/static_background.h"

namespace rigcal::agent {

// Connected pixels (8 neighbours) of one mask, each with weight 1.
struct Blob {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();          // mean of the pixels, img frame
  Eigen::Matrix2d second_moment_px2 = Eigen::Matrix2d::Zero();  // about that mean
  int area_px = 0;
  PixelRect box;
  bool touches_border = false;  // of the image, not of the window
};

// Of a component of an image's pixels.
Blob ToBlob(const ComponentSums& sums, const ImageView& image);

struct BlobFinderOptions {
  ColourRange colour;
  int min_area_px = 6;
  int max_area_px = 600000;  // markers are looked for in large blobs too
  int max_blobs = 512;       // more are counted, not kept: the largest ones stay
  // Runs of pixels in a row; an image of noise has a million. What is below is not looked at.
  int max_runs = 10000000;

  // Every fault.
  absl::Status Validate() const;
};

struct BlobResult {
  std::vector<Blob> blobs;  // from top to bottom, left to right by their first pixel
  int over_limit = 0;       // in area range, but beyond max_blobs
  int64_t passed_px = 0;    // pixels of the colour, of blobs of any size
  int64_t run_count = 0;    // of pixels in a row
  bool cut_short = false;   // by max_runs
  int row_count = 0;        // looked at
};

// Finds the connected pixels of a colour in one pass over an image: pixels to mask bits, bits to
// runs, runs to components and their moments. Buffers are kept from image to image. One thread
// at a time.
class BlobFinder {
 public:
  // Fails with INVALID_ARGUMENT if the options are not valid. `kernel` changes the speed,
  // never the result.
  static absl::StatusOr<BlobFinder> Create(BlobFinderOptions options,
                                           const MaskKernel& kernel = BestMaskKernel());

  // Pixels that never belong to a blob from now on, such as lamps. Pixels outside of the mask are
  // not ignored: a mask of another size than the images is the caller's fault to find.
  void SetIgnored(PixelMask ignored) { ignored_ = std::move(ignored); }
  // Pixels of this background do not either, while they look like it; null: none. It must outlive
  // the finder, and know of each new image (StaticBackground::BeginImage).
  void SetBackground(StaticBackground* background) { background_ = background; }

  // The blobs of an image, or of its part inside `window`; pixels outside are as if they were
  // black. The result is valid until the next call. An image without pixels has no blobs. `bright`,
  // if not null: of this image; of use where it was noted by a finder whose `value_min` is no
  // higher.
  const BlobResult& Find(const ImageView& image, PixelRect window,
                         const BrightWords* bright = nullptr);
  const BlobResult& Find(const ImageView& image) { return Find(image, image.Bounds()); }
  // The blobs of an image; notes which words are bright.
  const BlobResult& Look(const ImageView& image, BrightWords* bright);
  const BlobResult& result() const { return result_; }  // of the last Find or Look

  // The pixels of a row that may belong to a blob, as ColourMasker::MaskRow gives them; false:
  // none. `bright` as for Find.
  bool MaskRow(const ImageView& image, int y, int first_word, int word_count, uint64_t* words,
               const BrightWords* bright = nullptr) const;

 private:
  BlobFinder(BlobFinderOptions options, ColourMasker masker) : options_(options), masker_(masker) {}

  // Writes the words of a row of a mask; false: none.
  using RowReader = absl::FunctionRef<bool(int y, int first_word, int word_count, uint64_t* words)>;

  const BlobResult& Search(const ImageView& image, const PixelRect& window, RowReader read);
  void LabelRows(const PixelRect& window, RowReader read);
  // Without what is ignored.
  void Ignore(const ImageView& image, int y, int first_word, int word_count, uint64_t* words) const;
  void KeepBlobs(const ImageView& image, const std::vector<ComponentSums>& components);

  BlobFinderOptions options_;
  ColourMasker masker_;
  PixelMask ignored_;
  StaticBackground* background_ = nullptr;
  std::vector<uint64_t> words_;  // of one row
  RunLabeller labeller_;
  std::vector<int> kept_;  // components in the range of areas
  BlobResult result_;
};

}  // namespace rigcal::agent
