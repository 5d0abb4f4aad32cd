// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/spot_finder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "agent/detect/blobs/blob_contrast.h"
#include "agent/detect/blobs/disc_pair.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr int kNeverWashedOut = 256;  // ColourRange::washed_out_min
// Ranges of colour, and what a marker needs there.
struct LevelRange {
  double brighter = 0;                      // from value_min to the brightest
  double dimmer = 1;                        // of value_min
  double paler = 1;                         // of saturation_min
  bool white = false;                       // takes what the sensor has lost the colour of
  bool turned = false;                      // takes the hues to which clipping turns the wand's
  bool whitened = false;                    // takes what is bright in all channels instead
  double contrast_grey = kMinContrastGrey;  // over all channels
};
constexpr LevelRange kLevels[] = {
    {.white = true},
    {.brighter = 0.2, .white = true},
    {.brighter = 0.4, .white = true},
    {.brighter = 0.6, .white = true},
    {.brighter = 0.35, .paler = 0.55},
    {.paler = 0.55},
    {.brighter = 0.2, .paler = 0.55, .white = true, .turned = true},
    {.paler = 0.55, .whitened = true},
    // Noise gives colours to what is dark and grey: no paler than configured.
    {.dimmer = 0.5, .paler = 1.1, .contrast_grey = 20},
    {.contrast_grey = 14}};
constexpr double kPastSecondaryDeg = 3;
constexpr double kNearHueDeg = 20;  // of what a marker adds to its surroundings, which have a hue
// Of the colour of a marker itself that is found by its contrast: what is black before something
// bluish has none.
constexpr float kLeastOwnSaturation = 0.08f, kLeastOwnGrey = 4;
constexpr float kMuchBrighterGrey = 75;  // over all channels
constexpr int kLargeAreaPx = 800;
constexpr int kLeastPairPx = 40, kMostPairPx = 8000;  // of two spheres
constexpr int kMostPairs = 32;                        // of each level
constexpr double kLong = 0.18;
constexpr double kHalfDoubt = 3;        // few wands point at the camera, and many things are long
constexpr double kClearlyLess = 1;      // of a doubt
constexpr double kMostDoubtBefore = 4;  // of what is kept of the level before
constexpr int kPart = 4;  // a piece that much smaller is something in front of the other
constexpr int kColouredOfNine = 3, kPaleOfNine = 6;
constexpr int kClipped = 250;

constexpr int kMaxRuns = 12000;            // of each level, some 30 ns each
constexpr int64_t kMaxMaskedPx = 3000000;  // of boxes of patches, 0.3 ns each
constexpr int64_t kMaxSplitPx = 120000;    // of the same, 9 ns each
constexpr int kSearchesOfContrast = 4;     // that take as long as one by contrast
constexpr size_t kMaxSpots = 160;          // pairs of them, 5 ns each
// Of a marker's middle against the others, before it is measured.
constexpr double kAlikeDoubt = 11;  // where all around looks like it
constexpr double kLongerSigma = 0.15, kMostShapeDoubt = 4;
// Small things are many: titles of books, slats, letters.
constexpr double kFewBelowPx = 3.5, kSmallDoubt = 2;  // per pixel of the radius

double HueWidthDeg(const ColourRange& colour) {
  return std::fmod(colour.hue_max_deg - colour.hue_min_deg + 360, 360);
}

double MiddleHueDeg(const ColourRange& colour) {
  return std::fmod(colour.hue_min_deg + 0.5 * HueWidthDeg(colour), 360);
}

// The channel that is strongest in the middle of the range: 0 blue, 1 green, 2 red.
int MainChannel(const ColourRange& colour) {
  const double middle = MiddleHueDeg(colour);
  return middle < 60 || middle >= 300 ? 2 : middle < 180 ? 1 : 0;
}

// The channel that is weakest there.
int WeakestChannel(const ColourRange& colour) {
  const double middle = MiddleHueDeg(colour);
  return middle < 120 ? 0 : middle < 240 ? 2 : 1;
}

// Of the difference of two colours, blue, green, red; white in both changes nothing.
double HueDeg(const Eigen::Vector3f& bgr) {
  const float most = bgr.maxCoeff(), chroma = most - bgr.minCoeff();
  if (!(chroma > 0)) return 0;
  const float sixths = bgr[2] == most   ? (bgr[1] - bgr[0]) / chroma
                       : bgr[1] == most ? 2 + (bgr[0] - bgr[2]) / chroma
                                        : 4 + (bgr[2] - bgr[1]) / chroma;
  return std::fmod(60 * static_cast<double>(sixths) + 360, 360);
}

bool HasOwnColour(const Eigen::Vector3f& bgr) {
  const float most = bgr.maxCoeff();
  return most - bgr.minCoeff() >= std::max(kLeastOwnGrey, kLeastOwnSaturation * most);
}

// A hue of the range, or at most `beyond_deg` beyond it.
bool IsNear(double hue_deg, const ColourRange& colour, double beyond_deg) {
  const double from_min = std::fmod(hue_deg - colour.hue_min_deg + 720, 360);
  return from_min <= HueWidthDeg(colour) + beyond_deg || from_min >= 360 - beyond_deg;
}

// Before something of its own hue a marker that is much brighter may differ from it by any hue.
bool IsBrighterOfColour(const BlobContrast& contrast, const ColourRange& colour) {
  const double most = contrast.core.maxCoeff();
  return (contrast.core - contrast.around).norm() >= kMuchBrighterGrey &&
         contrast.core.norm() > contrast.around.norm() &&
         IsNear(HueDeg(contrast.core), colour, 0) && most >= colour.value_min &&
         most - contrast.core.minCoeff() >= colour.saturation_min * most;
}

// A range that also takes hues up to yellow, cyan or magenta, whichever is next to its middle:
// where the main channel is clipped, the second one catches up with it.
ColourRange WithClippedHues(ColourRange colour) {
  const double half_deg = 0.5 * HueWidthDeg(colour);
  const double middle = MiddleHueDeg(colour);
  const double primary = 120 * std::round(middle / 120);
  const double beyond = 60 + kPastSecondaryDeg;
  if (middle > primary) {
    const double more = primary + beyond - middle - half_deg;
    if (more > 0) colour.hue_max_deg = std::fmod(colour.hue_max_deg + more + 360, 360);
  } else {
    const double more = middle - half_deg - (primary - beyond);
    if (more > 0) colour.hue_min_deg = std::fmod(colour.hue_min_deg - more + 360, 360);
  }
  return colour;
}

double ShapeDoubt(const Blob& blob) {
  return std::min(kMostShapeDoubt, std::pow(Elongation(blob) / kLongerSigma, 2));
}

// Of two pieces of one thing: the one that looks more like a sphere, or the larger one.
bool IsBetter(const Spot& a, const Spot& b) {
  return std::abs(a.doubt - b.doubt) > kClearlyLess ? a.doubt < b.doubt
                                                    : a.blob.area_px > b.blob.area_px;
}

// A blob that a window inside the image may have cut.
bool TouchesEdge(const PixelRect& box, const PixelRect& window, const PixelRect& bounds) {
  return (box.x <= window.x && window.x > bounds.x) || (box.y <= window.y && window.y > bounds.y) ||
         (box.x + box.width >= window.x + window.width &&
          window.x + window.width < bounds.x + bounds.width) ||
         (box.y + box.height >= window.y + window.height &&
          window.y + window.height < bounds.y + bounds.height);
}

}  // namespace

SpotFinder::SpotFinder(const BlobFinderOptions& options, const WandMechanisms& without)
    : without_(without),
      min_area_px_(options.min_area_px),
      colour_(options.colour),
      main_channel_(MainChannel(options.colour)),
      contrast_(main_channel_, WeakestChannel(options.colour)) {}

absl::StatusOr<SpotFinder> SpotFinder::Create(const BlobFinderOptions& options,
                                              const WandMechanisms& without) {
  SpotFinder finder(options, without);
  for (const LevelRange& level : kLevels) {
    BlobFinderOptions its = options;
    its.max_runs = std::min(its.max_runs, kMaxRuns);
    its.colour.value_min += static_cast<int>(level.brighter * (255 - its.colour.value_min));
    its.colour.saturation_min = std::min(1.0, level.paler * its.colour.saturation_min);
    its.colour.value_min = std::max(1, static_cast<int>(level.dimmer * its.colour.value_min));
    if (!level.white) its.colour.washed_out_min = kNeverWashedOut;
    if (level.turned) its.colour = WithClippedHues(its.colour);
    // A spot has the wand's colour, whatever it was found by.
    RIGCAL_ASSIGN_OR_RETURN(ColourMasker masker, ColourMasker::Create(its.colour));
    if (level.whitened) {
      its.colour.washed_out_min = its.colour.value_min;
      its.colour.saturation_min = 1;
    }
    RIGCAL_ASSIGN_OR_RETURN(BlobFinder blobs, BlobFinder::Create(its));
    its.colour.washed_out_min = kNeverWashedOut;
    RIGCAL_ASSIGN_OR_RETURN(BlobFinder coloured, BlobFinder::Create(its));
    finder.levels_.push_back({std::move(blobs), std::move(coloured), masker});
  }
  return finder;
}

bool HasOtherHalves(absl::Span<const Spot> spots, absl::Span<const int> chosen) {
  return std::ranges::all_of(chosen, [&](int one) {
    const Spot& spot = spots[static_cast<size_t>(one)];
    return !spot.is_half || std::ranges::any_of(chosen, [&](int other) {
      return other != one && spots[static_cast<size_t>(other)].pair == spot.pair;
    });
  });
}

double SpotFinder::ContrastGreyOf(size_t level) { return kLevels[level].contrast_grey; }

void SpotFinder::SetIgnored(const PixelMask& ignored) {
  for (Level& level : levels_) {
    level.blobs.SetIgnored(ignored);
    level.coloured.SetIgnored(ignored);
  }
}

void SpotFinder::SetBackground(StaticBackground* background) {
  for (Level& level : levels_) {
    level.blobs.SetBackground(background);
    level.coloured.SetBackground(background);
  }
}

void SpotFinder::BeginImage() {
  masked_px_left_ = kMaxMaskedPx;
  split_px_left_ = kMaxSplitPx;
  runs_ = 0;
  searches_ = looked_at_ = found_ = 0;
  dismissed_ = 0;
  looked_ = false;
  has_whole_image_ = false;
}

const BlobResult& SpotFinder::Look(const ImageView& image) {
  level_ = 0;
  looked_ = true;
  return levels_[0].blobs.Look(image, &bright_);
}

double SpotFinder::EstimatedMs() const {
  return 0.13 * searches_ +
         1e-6 * (400.0 * looked_at_ + 850.0 * found_ + 30.0 * static_cast<double>(runs_) +
                 0.3 * static_cast<double>(kMaxMaskedPx - masked_px_left_) +
                 9.0 * static_cast<double>(kMaxSplitPx - split_px_left_));
}

// A part of its middle. Where the sensor is saturated in the wand's main channel its colour is
// lost.
bool SpotFinder::HasColour(const ImageView& image, const Blob& blob) const {
  const double reach = 0.5 * std::sqrt(blob.area_px / std::numbers::pi);
  const int least = kLevels[level_].white ? kColouredOfNine : kPaleOfNine;
  int passed = 0, left = 9;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) {
      // The rest changes nothing.
      if (passed >= least || passed + left < least) return passed >= least;
      --left;
      const auto x = static_cast<int>(std::lround(blob.centre_px.x() + reach * u));
      const auto y = static_cast<int>(std::lround(blob.centre_px.y() + reach * v));
      if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
      uint64_t word = 0;
      levels_[level_].masker.MaskRow(image, y, x / kMaskWordBits, 1, &word);
      const uint8_t* const pixel = image.Row(y) + x * BytesPerPixel(image.format);
      const bool colour = image.format == PixelFormat::kBgr8;
      // A room's white is nothing that the light of a wand has whitened.
      const bool white =
          colour && !kLevels[level_].white && std::min({pixel[0], pixel[1], pixel[2]}) >= kClipped;
      const bool clipped = !white && pixel[colour ? main_channel_ : 0] >= kClipped;
      passed += clipped || (word >> (x % kMaskWordBits) & 1) != 0 ? 1 : 0;
    }
  }
  return passed >= least;
}

void SpotFinder::Keep(const ImageView& image, const Blob& blob, bool is_cut, int pair) {
  Spot spot{blob, Eigen::Vector3f::Zero(), is_cut};
  ++looked_at_;
  // A piece of a patch is held to the wand's colour too.
  const auto contrast = StandsOut(image, blob, min_contrast_grey());
  if (!contrast) return;
  if (level_ != kContrastLevel) {
    if (!HasColour(image, blob)) return;
  } else if (image.format == PixelFormat::kBgr8 &&
             (!IsNear(HueDeg(contrast->core - contrast->around), colour_, kNearHueDeg) ||
              !HasOwnColour(contrast->core)) &&
             !IsBrighterOfColour(*contrast, colour_)) {
    return;
  }
  spot.core = contrast->core;
  const double radius_px = std::sqrt(blob.area_px / std::numbers::pi);
  spot.doubt = kAlikeDoubt * static_cast<double>(contrast->alike) + ShapeDoubt(blob) +
               kSmallDoubt * std::max(0.0, kFewBelowPx - radius_px);
  // The box of one blob may hold a part of another's pieces.
  for (Spot& known : spots_) {
    const int larger = std::max(known.blob.area_px, blob.area_px);
    const int smaller = std::min(known.blob.area_px, blob.area_px);
    const double squared_px2 = (known.blob.centre_px - blob.centre_px).squaredNorm();
    if (squared_px2 * std::numbers::pi >= larger) continue;
    if (kPart * smaller < larger) continue;  // not the same thing
    // Whether it is one sphere that moves or two is seen later.
    if (pair >= 0 && Elongation(known.blob) > kLong) continue;
    if (pair >= 0) {
      known.pair = pair;
    } else if (IsBetter(spot, known)) {
      known = spot;
    }
    return;
  }
  spot.pair = pair;
  spot.is_half = pair >= 0;
  if (spot.is_half) spot.doubt += kHalfDoubt;
  spots_.push_back(spot);
}

void SpotFinder::KeepOfLevelBefore(Spot spot) {
  if (spot.is_half || spot.doubt > kMostDoubtBefore) return;
  const auto known = std::ranges::find_if(spots_, [&](const Spot& one) {
    const int larger = std::max(one.blob.area_px, spot.blob.area_px);
    return (one.blob.centre_px - spot.blob.centre_px).squaredNorm() * std::numbers::pi < larger;
  });
  spot.pair = known == spots_.end() ? -1 : known->pair;
  if (known == spots_.end()) return spots_.push_back(spot);
  if (spot.doubt + kClearlyLess < known->doubt) *known = spot;
}

// Two spheres of a wand that points at the camera overlap. The largest blobs first: small things
// are many.
void SpotFinder::KeepPairs(const ImageView& image, const PixelRect& part) {
  std::stable_sort(pairs_.begin(), pairs_.end(),
                   [](const Blob* a, const Blob* b) { return a->area_px > b->area_px; });
  int tried = 0;
  for (const Blob* const blob : pairs_) {
    const auto discs = SplitPair(*blob);
    if (!discs) continue;
    for (const Blob& disc : *discs) {
      Keep(image, disc, TouchesEdge(blob->box, part, image.Bounds()), tried);
    }
    if (++tried >= kMostPairs) return;
  }
}

void SpotFinder::Find(const ImageView& image, const PixelRect& part, size_t level,
                      bool only_if_few) {
  const bool is_whole_image = part == image.Bounds();
  spots_before_.clear();
  if (level == kContrastLevel && is_whole_image && has_whole_image_) spots_before_.swap(spots_);
  has_whole_image_ = is_whole_image;
  level_ = level;
  spots_.clear();
  least_doubt_left_ = std::numeric_limits<double>::infinity();
  BlobFinder& finder = levels_[level_].blobs;
  const bool is_known = looked_ && level_ == 0 && part == image.Bounds();
  const BrightWords* const bright = looked_ ? &bright_ : nullptr;
  const BlobResult& found = is_known ? finder.result()
                            : level_ == kContrastLevel
                                ? finder.FindIn(image, part, contrast_.Mask(image, part))
                                : finder.Find(image, part, bright);
  runs_ += found.run_count;
  const int searches = level_ == kContrastLevel ? kSearchesOfContrast : 1;
  searches_ += found.row_count == image.height ? searches : 0;
  if (only_if_few && found.over_limit > 0) return;
  const auto is_cut = [&](const Blob& blob) { return TouchesEdge(blob.box, part, image.Bounds()); };
  // Those that a marker may be a part of, the smallest first.
  std::vector<const Blob*> patches;
  pairs_.clear();
  for (const Blob& blob : found.blobs) {
    const bool round = IsRound(blob);
    if (round) Keep(image, blob, is_cut(blob));
    // Of a large round one too: a sphere in front of a warm lampshade.
    if (level_ != kContrastLevel && (!round || blob.area_px >= kLargeAreaPx))
      patches.push_back(&blob);
    if (blob.area_px >= kLeastPairPx && blob.area_px <= kMostPairPx) pairs_.push_back(&blob);
  }
  const auto box_px = [](const Blob& blob) { return int64_t{blob.box.width} * blob.box.height; };
  std::stable_sort(patches.begin(), patches.end(),
                   [&](const Blob* a, const Blob* b) { return box_px(*a) < box_px(*b); });
  for (const Blob* const blob : patches) {
    // A sphere in front of a window or a lamp has merged with its white.
    if (masked_px_left_ < box_px(*blob)) {
      ++dismissed_;
      continue;
    }
    masked_px_left_ -= box_px(*blob);
    if (kLevels[level_].white && !without_.Has(WandMechanism::kColouredPatches)) {
      for (const Blob& coloured : levels_[level_].coloured.Find(image, blob->box, bright).blobs) {
        if (coloured.area_px < blob->area_px && IsRound(coloured)) {
          Keep(image, coloured, is_cut(*blob));
        }
      }
    }
    if (split_px_left_ < box_px(*blob)) {
      ++dismissed_;
      continue;
    }
    split_px_left_ -= box_px(*blob);
    if (!without_.Has(WandMechanism::kDiscs)) {
      for (const Blob& disc : discs_.Find(image, finder, *blob, min_area_px_, bright)) {
        Keep(image, disc, is_cut(*blob));
      }
    }
    if (without_.Has(WandMechanism::kPieces)) continue;
    for (const Blob& piece : splitter_.Split(image, *blob, min_area_px_)) {
      Keep(image, piece, is_cut(*blob));
    }
  }
  if (!without_.Has(WandMechanism::kDiscPairs)) KeepPairs(image, part);
  if (without_.Has(WandMechanism::kSpotsBefore)) spots_before_.clear();
  for (const Spot& spot : spots_before_) KeepOfLevelBefore(spot);
  found_ += static_cast<int>(std::min(spots_.size(), kMaxSpots));
  if (spots_.size() <= kMaxSpots) return;
  std::stable_sort(spots_.begin(), spots_.end(),
                   [](const Spot& a, const Spot& b) { return a.doubt < b.doubt; });
  least_doubt_left_ = spots_[kMaxSpots].doubt;
  spots_.resize(kMaxSpots);
}

}  // namespace rigcal::agent
