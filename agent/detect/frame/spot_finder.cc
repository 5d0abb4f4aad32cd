// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/spot_finder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "agent/detect/blobs/blob_contrast.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr int kNeverWashedOut = 256;  // a ColourRange::washed_out_min that takes no white
// A level: how its range differs from the configured colour.
struct LevelRange {
  double brighter = 0;  // share of the way from value_min to the brightest
  double paler = 1;     // factor of saturation_min
  bool white = false;   // takes pixels whose colour the sensor has lost
};
constexpr LevelRange kLevels[] = {
    {.white = true}, {.brighter = 0.35, .paler = 0.55}, {.paler = 0.55}};
constexpr int kLargeAreaPx = 800;   // px; round blobs from here on are searched for discs too
constexpr double kClearlyLess = 1;  // difference of two doubts
constexpr int kPart = 4;  // a piece so many times smaller is something in front of the other
// Pixels of nine in a spot's middle that must have the colour, in the wide and in the pale levels.
constexpr int kColouredOfNine = 3, kPaleOfNine = 6;
constexpr int kClipped = 250;  // grey levels

constexpr int kMaxRuns = 12000;          // runs of pixels per level, some 30 ns each
constexpr int64_t kMaxSplitPx = 120000;  // per image, in the boxes of patches; 9 ns each
constexpr size_t kMaxSpots = 160;        // per level; each pair of them takes 5 ns
// A spot's doubt, before it is measured.
constexpr double kAlikeDoubt = 11;                          // if all around looks like it
constexpr double kLongerSigma = 0.15, kMostShapeDoubt = 4;  // of elongation; limit of its doubt
// Small things are many, such as book titles, slats and letters; they get more doubt.
constexpr double kFewBelowPx = 3.5, kSmallDoubt = 2;  // per pixel of the radius

double HueWidthDeg(const ColourRange& colour) {
  return std::fmod(colour.hue_max_deg - colour.hue_min_deg + 360, 360);
}

double MiddleHueDeg(const ColourRange& colour) {
  return std::fmod(colour.hue_min_deg + 0.5 * HueWidthDeg(colour), 360);
}

// Returns the channel that is strongest in the middle of the range: 0 blue, 1 green, 2 red.
int MainChannel(const ColourRange& colour) {
  const double middle = MiddleHueDeg(colour);
  return middle < 60 || middle >= 300 ? 2 : middle < 180 ? 1 : 0;
}

double ShapeDoubt(const Blob& blob) {
  return std::min(kMostShapeDoubt, std::pow(Elongation(blob) / kLongerSigma, 2));
}

// Of two pieces of one thing, prefers the one that looks more like a sphere, or the larger one.
bool IsBetter(const Spot& a, const Spot& b) {
  return std::abs(a.doubt - b.doubt) > kClearlyLess ? a.doubt < b.doubt
                                                    : a.blob.area_px > b.blob.area_px;
}

// Tells whether an edge of the window inside of the image may have cut a blob.
bool TouchesEdge(const PixelRect& box, const PixelRect& window, const PixelRect& bounds) {
  return (box.x <= window.x && window.x > bounds.x) || (box.y <= window.y && window.y > bounds.y) ||
         (box.x + box.width >= window.x + window.width &&
          window.x + window.width < bounds.x + bounds.width) ||
         (box.y + box.height >= window.y + window.height &&
          window.y + window.height < bounds.y + bounds.height);
}

}  // namespace

SpotFinder::SpotFinder(const BlobFinderOptions& options)
    : min_area_px_(options.min_area_px), main_channel_(MainChannel(options.colour)) {}

absl::StatusOr<SpotFinder> SpotFinder::Create(const BlobFinderOptions& options) {
  SpotFinder finder(options);
  for (const LevelRange& level : kLevels) {
    BlobFinderOptions its = options;
    its.max_runs = std::min(its.max_runs, kMaxRuns);
    its.colour.value_min += static_cast<int>(level.brighter * (255 - its.colour.value_min));
    its.colour.saturation_min = std::min(1.0, level.paler * its.colour.saturation_min);
    if (!level.white) its.colour.washed_out_min = kNeverWashedOut;
    RIGCAL_ASSIGN_OR_RETURN(ColourMasker masker, ColourMasker::Create(its.colour));
    RIGCAL_ASSIGN_OR_RETURN(BlobFinder blobs, BlobFinder::Create(its));
    finder.levels_.push_back({std::move(blobs), masker});
  }
  return finder;
}

void SpotFinder::SetIgnored(const PixelMask& ignored) {
  for (Level& level : levels_) {
    level.blobs.SetIgnored(ignored);
  }
}

void SpotFinder::SetBackground(StaticBackground* background) {
  for (Level& level : levels_) {
    level.blobs.SetBackground(background);
  }
}

void SpotFinder::BeginImage() {
  split_px_left_ = kMaxSplitPx;
  dismissed_ = 0;
  looked_ = false;
}

const BlobResult& SpotFinder::Look(const ImageView& image) {
  level_ = 0;
  looked_ = true;
  return levels_[0].blobs.Look(image, &bright_);
}

// Tells whether enough of the blob's middle has the colour. A pixel that is saturated in the wand's
// main channel counts too, because its colour is lost.
bool SpotFinder::HasColour(const ImageView& image, const Blob& blob) const {
  const double reach = 0.5 * std::sqrt(blob.area_px / std::numbers::pi);
  const int least = kLevels[level_].white ? kColouredOfNine : kPaleOfNine;
  int passed = 0, left = 9;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) {
      // The other pixels cannot change the result.
      if (passed >= least || passed + left < least) return passed >= least;
      --left;
      const auto x = static_cast<int>(std::lround(blob.centre_px.x() + reach * u));
      const auto y = static_cast<int>(std::lround(blob.centre_px.y() + reach * v));
      if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
      uint64_t word = 0;
      levels_[level_].masker.MaskRow(image, y, x / kMaskWordBits, 1, &word);
      const uint8_t* const pixel = image.Row(y) + x * BytesPerPixel(image.format);
      const bool colour = image.format == PixelFormat::kBgr8;
      // What is white in a pale level is the room's, not a wand that light has whitened.
      const bool white =
          colour && !kLevels[level_].white && std::min({pixel[0], pixel[1], pixel[2]}) >= kClipped;
      const bool clipped = !white && pixel[colour ? main_channel_ : 0] >= kClipped;
      passed += clipped || (word >> (x % kMaskWordBits) & 1) != 0 ? 1 : 0;
    }
  }
  return passed >= least;
}

void SpotFinder::Keep(const ImageView& image, const Blob& blob, bool is_cut) {
  Spot spot{blob, Eigen::Vector3f::Zero(), is_cut};
  // A piece of a patch must have the wand's colour too.
  const auto contrast = StandsOut(image, blob);
  if (!contrast || !HasColour(image, blob)) return;
  spot.core = contrast->core;
  const double radius_px = std::sqrt(blob.area_px / std::numbers::pi);
  spot.doubt = kAlikeDoubt * static_cast<double>(contrast->alike) + ShapeDoubt(blob) +
               kSmallDoubt * std::max(0.0, kFewBelowPx - radius_px);
  // The box of one blob may hold pieces of another one that are known already.
  for (Spot& known : spots_) {
    const int larger = std::max(known.blob.area_px, blob.area_px);
    const int smaller = std::min(known.blob.area_px, blob.area_px);
    const double squared_px2 = (known.blob.centre_px - blob.centre_px).squaredNorm();
    if (squared_px2 * std::numbers::pi >= larger) continue;
    if (kPart * smaller < larger) continue;  // not the same thing
    if (IsBetter(spot, known)) known = spot;
    return;
  }
  spots_.push_back(spot);
}

void SpotFinder::Find(const ImageView& image, const PixelRect& part, size_t level) {
  level_ = level;
  spots_.clear();
  least_doubt_left_ = std::numeric_limits<double>::infinity();
  BlobFinder& finder = levels_[level_].blobs;
  const bool is_known = looked_ && level_ == 0 && part == image.Bounds();
  const BrightWords* const bright = looked_ ? &bright_ : nullptr;
  const BlobResult& found = is_known ? finder.result() : finder.Find(image, part, bright);
  const auto is_cut = [&](const Blob& blob) { return TouchesEdge(blob.box, part, image.Bounds()); };
  // Blobs that a marker may be a part of, the smallest first.
  std::vector<const Blob*> patches;
  for (const Blob& blob : found.blobs) {
    const bool round = IsRound(blob);
    if (round) Keep(image, blob, is_cut(blob));
    // A large round blob too: a sphere may be in front of a warm lampshade.
    if (!round || blob.area_px >= kLargeAreaPx) patches.push_back(&blob);
  }
  const auto box_px = [](const Blob& blob) { return int64_t{blob.box.width} * blob.box.height; };
  std::stable_sort(patches.begin(), patches.end(),
                   [&](const Blob* a, const Blob* b) { return box_px(*a) < box_px(*b); });
  for (const Blob* const blob : patches) {
    if (split_px_left_ < box_px(*blob)) {
      ++dismissed_;
      continue;
    }
    split_px_left_ -= box_px(*blob);
    for (const Blob& disc : discs_.Find(image, finder, *blob, min_area_px_, bright)) {
      Keep(image, disc, is_cut(*blob));
    }
  }
  if (spots_.size() <= kMaxSpots) return;
  std::stable_sort(spots_.begin(), spots_.end(),
                   [](const Spot& a, const Spot& b) { return a.doubt < b.doubt; });
  least_doubt_left_ = spots_[kMaxSpots].doubt;
  spots_.resize(kMaxSpots);
}

}  // namespace rigcal::agent
