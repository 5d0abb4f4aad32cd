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

// Connected pixels (8 neighbours) of one mask; all of them have weight 1.
struct Blob {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();          // mean of the pixels, img frame
  Eigen::Matrix2d second_moment_px2 = Eigen::Matrix2d::Zero();  // about that mean
  int area_px = 0;
  PixelRect box;
  bool touches_border = false;  // of the image, not of the search window
};

// Converts the sums over a component's pixels into a blob of `image`.
Blob ToBlob(const ComponentSums& sums, const ImageView& image);

struct BlobFinderOptions {
  ColourRange colour;
  int min_area_px = 6;
  int max_area_px = 600000;  // large, because markers are looked for inside of large blobs too
  int max_blobs = 512;       // the largest blobs are kept, the others are only counted
  // The search ends where the runs of mask pixels exceed this; an image of noise has a million.
  int max_runs = 10000000;

  // Returns all faults in one message.
  absl::Status Validate() const;
};

struct BlobResult {
  std::vector<Blob> blobs;  // in the order of their first pixels: top to bottom, left to right
  int over_limit = 0;       // blobs of a valid area that max_blobs left out
  int64_t passed_px = 0;    // mask pixels, in blobs of any size
  int64_t run_count = 0;    // runs of mask pixels
  bool cut_short = false;   // by max_runs: the rows below were not read
  int row_count = 0;        // rows that were read
};

// Finds the blobs of a colour in one pass over an image: pixels become mask bits, bits become runs,
// runs become components with moments. Buffers are kept; one thread at a time.
class BlobFinder {
 public:
  // Fails with INVALID_ARGUMENT if the options are not valid. The choice of `kernel` changes the
  // speed, never the result.
  static absl::StatusOr<BlobFinder> Create(BlobFinderOptions options,
                                           const MaskKernel& kernel = BestMaskKernel());

  // Sets pixels that never belong to a blob, such as lamps. Pixels outside of this mask are not
  // ignored; the caller must check that it has the size of the images.
  void SetIgnored(PixelMask ignored) { ignored_ = std::move(ignored); }
  // Also ignores the pixels of this background while they look like it; null: none. The background
  // must outlive the finder and be told of each new image (StaticBackground::BeginImage).
  void SetBackground(StaticBackground* background) { background_ = background; }

  // Returns the blobs of an image, or of its part inside `window`; pixels outside count as black.
  // The result is valid until the next call. An image without pixels has no blobs. `bright` (may be
  // null) lets the search skip dark words of this image. It is used if the finder that noted it has
  // no higher `value_min` than this one.
  const BlobResult& Find(const ImageView& image, PixelRect window,
                         const BrightWords* bright = nullptr);
  const BlobResult& Find(const ImageView& image) { return Find(image, image.Bounds()); }
  // Finds the blobs of an image and notes which of its words are bright.
  const BlobResult& Look(const ImageView& image, BrightWords* bright);
  const BlobResult& result() const { return result_; }  // of the last Find or Look

  // Writes the mask of a row like ColourMasker::MaskRow, without ignored pixels. Returns false if
  // no pixel has the colour. `bright` as for Find.
  bool MaskRow(const ImageView& image, int y, int first_word, int word_count, uint64_t* words,
               const BrightWords* bright = nullptr) const;

 private:
  BlobFinder(BlobFinderOptions options, ColourMasker masker) : options_(options), masker_(masker) {}

  // Writes the mask words of a row; returns false if none of its bits is set.
  using RowReader = absl::FunctionRef<bool(int y, int first_word, int word_count, uint64_t* words)>;

  const BlobResult& Search(const ImageView& image, const PixelRect& window, RowReader read);
  void LabelRows(const PixelRect& window, RowReader read);
  // Clears the bits of pixels that are ignored or belong to the background.
  void Ignore(const ImageView& image, int y, int first_word, int word_count, uint64_t* words) const;
  void KeepBlobs(const ImageView& image, const std::vector<ComponentSums>& components);

  BlobFinderOptions options_;
  ColourMasker masker_;
  PixelMask ignored_;
  StaticBackground* background_ = nullptr;
  std::vector<uint64_t> words_;  // mask of one row
  RunLabeller labeller_;
  std::vector<int> kept_;  // indices of the components with a valid area
  BlobResult result_;
};

}  // namespace rigcal::agent
