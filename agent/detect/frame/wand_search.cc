// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/wand_search.h"

#include <algorithm>
#include <utility>

#include "agent/detect/frame/colour_share.h"
#include "agent/detect/frame/image_exposure.h"
#include "agent/detect/frame/spot_likeness.h"

namespace rigcal::agent {
namespace {

// What the search of one image may cost. A wand in a room takes a twentieth of it.
constexpr int kMostFits = 500;          // poses, 2.5 us each on a PC of 2020
constexpr double kMostPixels = 28000;   // read to measure candidates, 0.11 us each
constexpr int kFitsOfLevel = 300;       // poses per level, so that some are left for the next one
constexpr double kPixelsOfLevel = 0.5;  // share of the pixels left that a level may read
constexpr int kMaxCandidates = 200;     // candidates that are compared by their colour
constexpr size_t kMaxMeasured = 30;     // candidates that are measured
// Shares of the pixels.
constexpr double kWhiteRoom = 0.01;  // share of white pixels; saturated spheres have less
constexpr double kLitRoom = 0.02;    // share of pixels brighter than a dark room's
// In units of WandCandidate::cost.
constexpr double kSureCost = 4;      // cost of a wand below which nothing left out is as good
constexpr double kALittleWorse = 2;  // a candidate with less excess cost is hardly less likely

}  // namespace

WandSearch::WandSearch(const WandLimits& limits, int washed_out_min, const WandMechanisms& without,
                       const Target& target, const CameraDescription& camera,
                       SpotFinder spot_finder)
    : washed_out_min_(washed_out_min),
      without_(without),
      wand_finder_({.limits = limits, .max_candidates = kMaxCandidates}, target, camera),
      verifier_(limits.min_confidence, without),
      spot_finder_(std::move(spot_finder)) {}

void WandSearch::StartImage() {
  cut_short_ = false;
  is_lit_.reset();
  passed_share_ = white_share_ = 0;
  fits_left_ = kMostFits;
  pixels_left_ = kMostPixels;
  spot_finder_.BeginImage();
  verifier_.StartImage();
}

bool WandSearch::IsLit(const ImageView& image) {
  if (!is_lit_) is_lit_ = LitShare(image) >= kLitRoom;
  return *is_lit_;
}

// The light of a room whitens the spheres; a dark room has none. In front of white things only what
// has a colour can be told from them, so the wide level comes last.
std::vector<size_t> WandSearch::LevelsFor(const ImageView& image) {
  const bool is_white = white_share_ > kWhiteRoom;
  std::vector<size_t> levels;
  if (!is_white) levels.push_back(SpotFinder::kWideLevel);
  if ((is_white || IsLit(image)) && !without_.Has(WandMechanism::kPaleLevels)) {
    levels.insert(levels.end(), std::begin(SpotFinder::kPaleLevels),
                  std::end(SpotFinder::kPaleLevels));
  }
  if (is_white) levels.push_back(SpotFinder::kWideLevel);
  return levels;
}

Verdict WandSearch::SearchAll(const ImageView& image) {
  const BlobResult& look = spot_finder_.Look(image);
  passed_share_ = static_cast<double>(look.passed_px) /
                  std::max(1.0, static_cast<double>(look.row_count) * image.width);
  if (passed_share_ > kWhiteRoom) white_share_ = WhiteShare(image, washed_out_min_);
  bool is_ambiguous = false;
  for (const size_t level : LevelsFor(image)) {
    Verdict verdict = Search(image, image.Bounds(), level);
    if (verdict.wand) return verdict;
    is_ambiguous |= verdict.ambiguous;
    // An ambiguity of the wide level may be a window's slats, which look alike but have no colour.
    if (is_ambiguous && level != SpotFinder::kWideLevel) break;
  }
  Verdict none;
  none.ambiguous = is_ambiguous;
  return none;
}

void WandSearch::FindCandidates() {
  standing_out_.clear();
  cores_.clear();
  doubts_.clear();
  for (const Spot& spot : spot_finder_.spots()) {
    standing_out_.push_back(spot.blob);
    cores_.push_back(spot.core);
    doubts_.push_back(spot.doubt);
  }
  wand_finder_.LimitFits(std::min(fits_left_, kFitsOfLevel));
  candidates_ = wand_finder_.Find(standing_out_, {}, cores_, doubts_);
  fits_left_ -= wand_finder_.fits();
  for (WandCandidate& candidate : candidates_) {
    candidate.cost += Unlikeness(spot_finder_.spots(), candidate);
  }
  std::ranges::stable_sort(candidates_, {}, &WandCandidate::cost);
  if (candidates_.size() > kMaxMeasured) candidates_.resize(kMaxMeasured);
}

bool WandSearch::MayHaveRivals(const Verdict& verdict) const {
  const auto chosen = std::ranges::find(candidates_, verdict.wand->blobs, &WandCandidate::blobs);
  // The wand's log-odds in the units of a candidate's cost.
  const double cost = (MostLogOdds(*is_lit_) - verdict.wand->log_odds) / WandVerifier::kCostLogOdds;
  const bool is_sure = cost < kSureCost && spot_finder_.least_doubt_left() > cost + kALittleWorse;
  if (wand_finder_.cut_short() && !is_sure &&
      wand_finder_.least_cost_left() < chosen->cost + kALittleWorse) {
    return true;
  }
  if (!verdict.left_out || verdict.measured == candidates_.size()) return false;
  return candidates_[verdict.measured].cost <
         chosen->cost + (is_sure ? kALittleWorse : WandVerifier::kClearlyWorse);
}

Verdict WandSearch::Search(const ImageView& image, const PixelRect& part, size_t level) {
  window_ = part;
  spot_finder_.Find(image, part, level);
  FindCandidates();
  const double pixels = kPixelsOfLevel * pixels_left_;
  double left = pixels;
  Verdict verdict =
      verifier_.Verify(image, standing_out_, wand_finder_, candidates_, IsLit(image), &left);
  pixels_left_ -= pixels - left;
  cut_short_ |=
      !spot_finder_.has_all() || wand_finder_.cut_short() || result().cut_short || verdict.left_out;
  if (!verdict.wand) return verdict;
  if (MayHaveRivals(verdict)) {
    verdict.ambiguous = true;
    verdict.wand.reset();
  } else if (!verifier_.FitOutlines(image, &*verdict.wand)) {
    verdict.wand.reset();
  }
  return verdict;
}

std::optional<VerifiedWand> WandSearch::SearchPart(const ImageView& image, const PixelRect& part) {
  const Verdict verdict = Search(image, part, spot_finder_.level());
  if (!verdict.wand.has_value() || verdict.wand->OccludedCount() > 0) return std::nullopt;
  for (const int blob : verdict.wand->blobs) {
    if (spot_finder_.spots()[static_cast<size_t>(blob)].is_cut) return std::nullopt;
  }
  return verdict.wand;
}

}  // namespace rigcal::agent
