// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/blob_finder.h"

#include <algorithm>

#include "common/status/fault_list.h"

namespace rigcal::agent {
namespace {

PixelRect Clip(const PixelRect& rect, const ImageView& image) {
  const int64_t right = std::min<int64_t>(int64_t{rect.x} + rect.width, image.width);
  const int64_t bottom = std::min<int64_t>(int64_t{rect.y} + rect.height, image.height);
  const int x = std::max(0, rect.x), y = std::max(0, rect.y);
  return {x, y, static_cast<int>(std::max<int64_t>(0, right - x)),
          static_cast<int>(std::max<int64_t>(0, bottom - y))};
}

// Returns sum_ab / n - (sum_a / n) (sum_b / n); loses no digits far from the image's origin.
double CentralMoment(int64_t n, int64_t sum_ab, int64_t sum_a, int64_t sum_b) {
  const __int128 scaled = static_cast<__int128>(n) * sum_ab - static_cast<__int128>(sum_a) * sum_b;
  const auto count = static_cast<double>(n);
  return static_cast<double>(scaled) / count / count;
}

}  // namespace

Blob ToBlob(const ComponentSums& sums, const ImageView& image) {
  Blob blob;
  const auto n = static_cast<double>(sums.area);
  blob.centre_px = {static_cast<double>(sums.x) / n, static_cast<double>(sums.y) / n};
  const double xx = CentralMoment(sums.area, sums.xx, sums.x, sums.x);
  const double xy = CentralMoment(sums.area, sums.xy, sums.x, sums.y);
  const double yy = CentralMoment(sums.area, sums.yy, sums.y, sums.y);
  blob.second_moment_px2 << xx, xy, xy, yy;
  blob.area_px = static_cast<int>(sums.area);
  blob.box = {sums.min_x, sums.min_y, sums.max_x - sums.min_x + 1, sums.max_y - sums.min_y + 1};
  blob.touches_border = sums.min_x == 0 || sums.min_y == 0 || sums.max_x == image.width - 1 ||
                        sums.max_y == image.height - 1;
  return blob;
}

absl::Status BlobFinderOptions::Validate() const {
  FaultList faults;
  faults.Add(colour.Validate());
  if (min_area_px < 1) faults.Add("min_area is ", min_area_px, " px, but must be at least 1");
  if (max_area_px < min_area_px) {
    faults.Add("max_area is ", max_area_px, " px, but must be at least min_area, ", min_area_px);
  }
  if (max_runs < 1) faults.Add("max_runs is ", max_runs, ", but must be at least 1");
  if (max_blobs < 1) faults.Add("max_blobs is ", max_blobs, ", but must be at least 1");
  return faults.Result("blob finder: ");
}

absl::StatusOr<BlobFinder> BlobFinder::Create(BlobFinderOptions options, const MaskKernel& kernel) {
  if (absl::Status status = options.Validate(); !status.ok()) return status;
  absl::StatusOr<ColourMasker> masker = ColourMasker::Create(options.colour, kernel);
  if (!masker.ok()) return masker.status();
  return BlobFinder(options, *masker);
}

const BlobResult& BlobFinder::Find(const ImageView& image, PixelRect window,
                                   const BrightWords* bright) {
  return Search(image, window, [&](int y, int first_word, int word_count, uint64_t* words) {
    return MaskRow(image, y, first_word, word_count, words, bright);
  });
}

const BlobResult& BlobFinder::Look(const ImageView& image, BrightWords* bright) {
  bright->Start((image.width + kMaskWordBits - 1) / kMaskWordBits, image.height,
                options_.colour.value_min);
  const BlobResult& found =
      Search(image, image.Bounds(), [&](int y, int first_word, int word_count, uint64_t* words) {
        uint8_t* const row = bright->MutableRow(y);
        if (masker_.MaskRow(image, y, first_word, word_count, words, row) == 0) return false;
        Ignore(image, y, first_word, word_count, words);
        return true;
      });
  if (found.cut_short) bright->AssumeFrom(found.row_count);
  return found;
}

const BlobResult& BlobFinder::Search(const ImageView& image, const PixelRect& window,
                                     RowReader read) {
  result_.blobs.clear();
  result_.over_limit = 0;
  result_.passed_px = 0;
  result_.run_count = 0;
  result_.cut_short = false;
  result_.row_count = 0;
  const PixelRect inside = Clip(window, image);
  if (image.data == nullptr || inside.empty()) return result_;
  LabelRows(inside, read);
  KeepBlobs(image, labeller_.Finish());
  return result_;
}

bool BlobFinder::MaskRow(const ImageView& image, int y, int first_word, int word_count,
                         uint64_t* words, const BrightWords* bright) const {
  uint64_t all = 0;
  // Words that were dark for a higher value_min may be bright enough here.
  if (bright == nullptr || bright->value_min() > options_.colour.value_min) {
    all = masker_.MaskRow(image, y, first_word, word_count, words);
  } else {
    const int end = first_word + word_count;
    std::fill_n(words, word_count, uint64_t{0});
    for (int i = first_word; (i = bright->Next(y, i, end, true)) < end;) {
      const int next = bright->Next(y, i, end, false);
      all |= masker_.MaskRow(image, y, i, next - i, words + (i - first_word));
      i = next;
    }
  }
  if (all == 0) return false;
  Ignore(image, y, first_word, word_count, words);
  return true;
}

void BlobFinder::Ignore(const ImageView& image, int y, int first_word, int word_count,
                        uint64_t* words) const {
  if (y < ignored_.height()) {
    const int ignored_words = std::min(word_count, ignored_.words_per_row() - first_word);
    const uint64_t* ignored = ignored_.Row(y) + first_word;
    for (int i = 0; i < ignored_words; ++i) words[i] &= ~ignored[i];
  }
  if (background_ != nullptr) background_->Remove(image, y, first_word, word_count, words);
}

void BlobFinder::LabelRows(const PixelRect& window, RowReader read) {
  const int first_word = window.x / kMaskWordBits;
  const int last_column = window.x + window.width - 1;
  const int word_count = last_column / kMaskWordBits - first_word + 1;
  const uint64_t first_bits = ~uint64_t{0} << (window.x % kMaskWordBits);
  const uint64_t last_bits = ~uint64_t{0} >> (kMaskWordBits - 1 - last_column % kMaskWordBits);
  words_.resize(static_cast<size_t>(word_count));
  labeller_.Start(word_count);
  for (int y = window.y; y < window.y + window.height; ++y) {
    uint64_t* words = words_.data();
    ++result_.row_count;
    if (!read(y, first_word, word_count, words)) continue;
    words[0] &= first_bits;
    words[word_count - 1] &= last_bits;
    labeller_.AddRow(y, first_word * kMaskWordBits, words, word_count);
    result_.run_count = labeller_.run_count();
    result_.cut_short = result_.run_count > options_.max_runs;
    if (result_.cut_short) return;
  }
}

void BlobFinder::KeepBlobs(const ImageView& image, const std::vector<ComponentSums>& components) {
  kept_.clear();
  for (size_t i = 0; i < components.size(); ++i) {
    const int64_t area = components[i].area;
    result_.passed_px += area;
    if (area < options_.min_area_px || area > options_.max_area_px) continue;
    kept_.push_back(static_cast<int>(i));
  }
  const auto limit = static_cast<size_t>(options_.max_blobs);
  if (kept_.size() > limit) {
    result_.over_limit = static_cast<int>(kept_.size() - limit);
    const auto larger = [&components](int a, int b) {
      const int64_t area_a = components[static_cast<size_t>(a)].area;
      const int64_t area_b = components[static_cast<size_t>(b)].area;
      return area_a != area_b ? area_a > area_b : a < b;
    };
    std::nth_element(kept_.begin(), kept_.begin() + options_.max_blobs, kept_.end(), larger);
    kept_.resize(limit);
    std::sort(kept_.begin(), kept_.end());
  }
  for (const int i : kept_) {
    result_.blobs.push_back(ToBlob(components[static_cast<size_t>(i)], image));
  }
}

}  // namespace rigcal::agent
