// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/wand_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "agent/detect/frame/colour_share.h"
#include "agent/detect/frame/image_exposure.h"
#include "agent/detect/frame/spot_likeness.h"
#include "agent/identify/partial_wands.h"
#include "agent/identify/whole_candidate.h"

namespace rigcal::agent {
namespace {

// Of wands of which a marker is hidden.
constexpr size_t kMaxPartial = 12, kFewThings = 12;
constexpr double kWorkOfPlaces = 8000;  // in pixels, where hidden markers may be
constexpr double kWorkOfPartial = 5500, kShareOfPartial = 0.45;  // their verification
constexpr double kWorkOfParts = 4500;                            // of both, what others leave
constexpr double kWorkOfWhole = 7000;                            // that another look finds
constexpr double kLeastWorkOfWhole = 2500;                       // of a wand that is found
constexpr size_t kMostThirds = 4;                                // markers that nothing found
constexpr double kPartialLabels = 0.65;                          // their confidence

// What a part of a search may take of the budget.
constexpr int kFitsOfLevel = 300;
constexpr int kMaxCandidates = 200;  // that are compared by their colour
constexpr size_t kMaxMeasured = 30;  // of them
constexpr double kWorkOfLevel = 8000;
// Of a level of a crowded picture: something is left for those that follow.
constexpr int kFitsOfCrowded = 150;
constexpr double kWorkOfCrowded = 5000;
constexpr double kWorkOfNext = 4000;
constexpr double kWorkOfOccluded = 12000;
constexpr double kLikelyCost = 12, kWorkOfUnlikely = 2000;  // a wand rarely begins with more
constexpr size_t kFirstCandidates = 2;
constexpr double kWhiteRoom = 0.01;  // of the pixels: more than saturated spheres
constexpr double kLeastLit = 0.02;   // of the pixels
constexpr double kMuchOfItsColour = 0.1, kMostlyItsColour = 0.2;  // of the pixels
constexpr double kLittleMs = 1.8, kDimMs = 2.4;
constexpr double kAnotherLevelMs = 1.1;  // less: a hidden marker is looked for in another level
// A marker of which so little is seen is hidden, in any level.
constexpr double kHiddenShare = 0.6, kSureOfPart = 0.98;
constexpr double kKnownWhole = 0.2;   // of a radius, each marker's place
constexpr double kWholeGain = 5;      // in cost, against the same with a hidden marker
constexpr double kNoFurtherMs = 3.1;  // by the times above: no other level is begun
constexpr double kThirdMs = 3.6;      // nor is what stood out looked at again
constexpr double kALittleWorse = 2;
constexpr double kSureCost = 4;  // of a wand

bool IsSurelyHidden(const VerifiedWand& wand) {
  return wand.has_part && wand.part_share > 0 && wand.part_share < kHiddenShare &&
         wand.confidence > kSureOfPart;
}

}  // namespace

WandSearch::WandSearch(const WandLimits& limits, int washed_out_min, bool may_be_dim,
                       const WandMechanisms& without, const Target& target,
                       const CameraDescription& camera, SpotFinder spot_finder)
    : washed_out_min_(washed_out_min),
      may_be_dim_(may_be_dim && !without.Has(WandMechanism::kDimLevel)),
      without_(without),
      image_size_px_(camera.image_size_px),
      wand_finder_({.limits = limits, .max_candidates = kMaxCandidates}, target, camera),
      verifier_(limits.min_confidence, without),
      spot_finder_(std::move(spot_finder)) {}

void WandSearch::StartImage() {
  cut_short_ = parts_left_ = false;
  is_lit_.reset();
  passed_share_ = white_share_ = 0;
  spot_finder_.BeginImage();
  verifier_.StartImage();
  budget_.StartImage();
  by_evidence_.reset();
  contrast_spots_.clear();
}

double WandSearch::ShareOf(int64_t count_px) const {
  return static_cast<double>(count_px) /
         (static_cast<double>(image_size_px_.width) * static_cast<double>(image_size_px_.height));
}

// More passes than a wand and some things of its colour.
bool WandSearch::IsCrowded() const {
  return result().over_limit > 0 || result().cut_short ||
         ShareOf(result().passed_px) > kCrowdedShare;
}

bool WandSearch::IsLit(const ImageView& image) {
  if (!is_lit_) is_lit_ = LitShare(image) >= kLeastLit;
  return *is_lit_;
}

double WandSearch::EstimatedMs() const { return budget_.EstimatedMs(spot_finder_.EstimatedMs()); }

Verdict WandSearch::SearchAll(const ImageView& image) {
  std::optional<VerifiedWand> of_parts;
  Verdict verdict = SearchLevels(image, &of_parts);
  const auto has_none = [&] { return !verdict.wand && !verdict.ambiguous && !of_parts; };
  if (has_none() && parts_left_) verdict = SearchPartial(image, spot_finder_.spots(), 0);
  if (has_none() && !without_.Has(WandMechanism::kThirdByContrast) && !by_evidence_ &&
      !contrast_spots_.empty() && EstimatedMs() < kThirdMs) {
    verifier_.RequireContrast(SpotFinder::ContrastGreyOf(SpotFinder::kContrastLevel));
    verdict = SearchPartial(image, contrast_spots_, 0, true);
  }
  if (has_none()) verdict.wand = std::move(by_evidence_);
  const double gain = verdict.wand && verdict.wand->OccludedCount() == 0 ? kWholeGain : 0;
  if (of_parts && (!verdict.wand || verdict.wand->cost > of_parts->cost + gain)) {
    verdict = Verdict();
    verdict.wand = std::move(of_parts);
  }
  return verdict;
}

// `of_parts`: a wand with a marker that is not seen whole, which may be whole in a later level.
Verdict WandSearch::SearchLevels(const ImageView& image, std::optional<VerifiedWand>* of_parts) {
  const BlobResult& look = spot_finder_.Look(image);
  passed_share_ = static_cast<double>(look.passed_px) /
                  std::max(1.0, static_cast<double>(look.row_count) * image.width);
  if (passed_share_ > kWhiteRoom) {
    white_share_ = WhiteShare(image, washed_out_min_);
  }
  const bool is_white = white_share_ > kWhiteRoom;
  Verdict verdict;
  // False: there is time for more.
  const auto search = [&](size_t level, bool only_if_few = false) {
    cut_short_ |= EstimatedMs() > kNoFurtherMs;
    if (EstimatedMs() > kNoFurtherMs) return true;
    verdict = Search(image, image.Bounds(), level, only_if_few);
    if (verdict.wand && verdict.wand->OccludedCount() > 0 && !IsSurelyHidden(*verdict.wand) &&
        (level < SpotFinder::kPaleLevels[1] || level == SpotFinder::kContrastLevel) &&
        EstimatedMs() < kAnotherLevelMs && (is_white || IsLit(image))) {
      if (!*of_parts || verdict.wand->cost < (*of_parts)->cost) *of_parts = verdict.wand;
      verdict.wand.reset();
    }
    return verdict.wand.has_value() || has_rivals_;
  };
  bool has_tried_contrast = false;
  // What stands out of a lit room. Rivals are told apart in other levels.
  const auto search_contrast = [&](bool only_if_few) {
    if (without_.Has(WandMechanism::kContrastLevel) || has_tried_contrast || *of_parts ||
        !(is_white || IsLit(image)))
      return false;
    const bool found = search(SpotFinder::kContrastLevel, only_if_few);
    has_tried_contrast = !only_if_few || result().over_limit == 0;
    if (found && !has_rivals_) return true;
    verdict = Verdict();
    has_rivals_ = false;
    return false;
  };
  for (const size_t level : SpotFinder::kWideLevels) {
    if (is_white) break;
    if (level > 0 && without_.Has(WandMechanism::kBrighterLevels)) break;
    if (search(level) && !has_rivals_) return verdict;
    // A window's slats look alike, but have no colour.
    if (has_rivals_) break;
    const bool is_crowded = IsCrowded();  // this level
    // What stands out is less than what has its colour. Of surfaces that are brighter pieces do.
    const bool is_much = is_crowded && passed_share_ > kMuchOfItsColour;
    if (!is_much && search_contrast(is_crowded)) return verdict;
    if (!is_crowded) break;
    if (level == 0 && passed_share_ > kMostlyItsColour && IsLit(image) &&
        !without_.Has(WandMechanism::kWhitenedLevel)) {
      if (search(SpotFinder::kWhitenedLevel) && !has_rivals_) return verdict;
    }
  }
  // No light of a dark room whitens a sphere.
  if (!is_white && !IsLit(image)) {
    if (has_rivals_ || (passed_share_ > 0 && !without_.Has(WandMechanism::kClippedLevel) &&
                        search(SpotFinder::kClippedLevel)))
      return verdict;
    if (may_be_dim_) search(SpotFinder::kDimLevel);
    return verdict;
  }
  for (const size_t level : SpotFinder::kPaleLevels) {
    if (without_.Has(WandMechanism::kPaleLevels)) {
      if (search_contrast(false)) return verdict;
      break;
    }
    if (search(level) || search_contrast(false)) return verdict;
  }
  if (may_be_dim_ && EstimatedMs() < kDimMs && search(SpotFinder::kDimLevel)) return verdict;
  // Where hardly anything has a colour the spheres may be white too.
  if (is_white && EstimatedMs() < kLittleMs) search(SpotFinder::kWideLevels[0]);
  return verdict;
}

// What was left out is hardly as good.
bool WandSearch::IsSure(const VerifiedWand& wand) const {
  return wand.cost < kSureCost && spot_finder_.least_doubt_left() > wand.cost + kALittleWorse;
}

// The first candidates may take all the work that is left: they are hardly ever others than the
// wand. With a wand found, so may what may be as good. What is not likely gets little.
Verdict WandSearch::VerifyFound(const ImageView& image, double most_work) {
  const absl::Span<const WandCandidate> all = candidates_;
  const auto verify = [&](size_t count, double most) {
    double work = budget_.TakeWork(most);
    Verdict verdict = verifier_.Verify(image, standing_out_, wand_finder_, all.first(count), tried_,
                                       IsLit(image), &work);
    budget_.GiveBackWork(work);
    return verdict;
  };
  const size_t first = std::min(all.size(), kFirstCandidates);
  Verdict verdict = verify(first, budget_.work_left());
  if (all.size() == first) return verdict;
  const auto likely = static_cast<size_t>(std::ranges::count_if(
      all, [](const WandCandidate& candidate) { return candidate.cost < kLikelyCost; }));
  // A wand with a marker that is hidden may be looked for next.
  const auto spared = [this] { return std::max(0.0, budget_.work_left() - kWorkOfParts); };
  if (!verdict.wand && likely > first) verdict = verify(likely, std::min(most_work, spared()));
  if (!verdict.wand && likely == all.size()) return verdict;
  if (!verdict.wand) return verify(all.size(), std::min(kWorkOfUnlikely, spared()));
  return verify(all.size(),
                verdict.wand->OccludedCount() == 0 ? budget_.work_left() : kWorkOfOccluded);
}

Verdict WandSearch::Search(const ImageView& image, const PixelRect& part, size_t level,
                           bool only_if_few) {
  window_ = part;
  parts_left_ = false;
  spot_finder_.Find(image, part, level, only_if_few);
  verifier_.RequireContrast(spot_finder_.min_contrast_grey());
  cut_short_ |= !spot_finder_.has_all();
  standing_out_.clear();
  cores_.clear();
  doubts_.clear();
  for (const Spot& spot : spot_finder_.spots()) {
    standing_out_.push_back(spot.blob);
    cores_.push_back(spot.core);
    doubts_.push_back(spot.doubt);
  }
  const bool more_follow =
      part == image.Bounds() && level < SpotFinder::kPaleLevels[0] && IsCrowded();
  wand_finder_.LimitFits(
      std::min(budget_.fits_left(), more_follow ? kFitsOfCrowded : kFitsOfLevel));
  const std::vector<WandCandidate>& found = wand_finder_.Find(standing_out_, {}, cores_, doubts_);
  budget_.UseFits(wand_finder_.fits());
  // What other levels tried was of their colours, not of what stands out.
  tried_ = level == SpotFinder::kContrastLevel ? wand_finder_.fits() : budget_.fits();
  cut_short_ |= wand_finder_.cut_short() || result().cut_short;
  // The most likely are measured first.
  std::vector<std::pair<double, size_t>> order;
  for (size_t i = 0; i < found.size(); ++i) {
    if (!HasOtherHalves(spot_finder_.spots(), found[i].blobs)) continue;
    order.emplace_back(found[i].cost + Unlikeness(spot_finder_.spots(), found[i]), i);
  }
  std::sort(order.begin(), order.end());
  candidates_.clear();
  for (size_t i = 0; i < std::min(order.size(), kMaxMeasured); ++i) {
    candidates_.push_back(found[order[i].second]);
    candidates_.back().cost = order[i].first;
  }
  budget_.CutWork(spot_finder_.EstimatedMs());
  const bool is_first = more_follow || level == SpotFinder::kContrastLevel;
  Verdict verdict = VerifyFound(image, is_first ? kWorkOfCrowded : kWorkOfLevel);
  has_rivals_ = verdict.ambiguous;
  const bool all = verdict.measured == order.size();
  cut_short_ |= verdict.left_out;
  // What was left out may be as good.
  const auto may_have_rivals = [&] {
    if (all && !wand_finder_.cut_short()) return false;
    const auto chosen = std::find_if(candidates_.begin(), candidates_.end(), [&](const auto& one) {
      return one.blobs == verdict.wand->blobs;
    });
    const double its_cost = order[static_cast<size_t>(chosen - candidates_.begin())].first;
    const bool sure = IsSure(*verdict.wand);
    const double worse = sure ? kALittleWorse : WandVerifier::kClearlyWorse;
    const bool is_set_left = wand_finder_.cut_short() && !sure &&
                             wand_finder_.least_cost_left() < its_cost + kALittleWorse;
    return is_set_left ||
           (verdict.left_out && !all && order[verdict.measured].first < its_cost + worse);
  };
  if (verdict.wand && verdict.wand->OccludedCount() > 0 && verifier_.IsByEvidence(*verdict.wand)) {
    // Another search may show all of it, and loses nothing by this one.
    const bool is_better = !by_evidence_ || verdict.wand->cost < by_evidence_->cost;
    if (is_better && part == image.Bounds() && !may_have_rivals() &&
        verifier_.FitOutlines(image, &*verdict.wand)) {
      by_evidence_ = std::move(verdict.wand);
    }
    verdict.wand.reset();
  }
  if (!verdict.wand && !verdict.ambiguous && part == image.Bounds()) {
    // Whole wands are looked for in the next levels first: light of a room whitens the spheres.
    parts_left_ = more_follow || level == SpotFinder::kContrastLevel ||
                  (level < SpotFinder::kPaleLevels[0] && IsLit(image));
    if (level == SpotFinder::kContrastLevel) contrast_spots_ = spot_finder_.spots();
    if (parts_left_) return verdict;
    return SearchPartial(image, spot_finder_.spots(),
                         level < SpotFinder::kPaleLevels[1] ? kWorkOfNext : 0);
  }
  if (!verdict.wand) return verdict;
  if (!may_have_rivals()) {
    if (!verifier_.FitOutlines(image, &*verdict.wand)) verdict.wand.reset();
    return verdict;
  }
  verdict.ambiguous = true;
  const bool is_whole = verdict.wand->OccludedCount() == 0;
  verdict.wand.reset();
  // Of two spheres and something else, another thing may be the third one's part.
  if (is_whole || more_follow || part != image.Bounds()) return verdict;
  return SearchPartial(image, spot_finder_.spots(), kWorkOfNext);
}

// A wand of which one marker is mostly hidden. `kept_work` is for what follows.
Verdict WandSearch::SearchPartial(const ImageView& image, absl::Span<const Spot> spots,
                                  double kept_work, bool look_for_third) {
  if (without_.Has(WandMechanism::kPartialWands)) return {};
  std::vector<WholeMarker> wholes;
  for (const Spot& spot : spots) {
    if (!IsRound(spot.blob) || spot.blob.touches_border || spot.is_half) continue;
    wholes.push_back({spot.blob, spot.core, spot.doubt});
  }
  const double kept = budget_.TakeWork(std::min(0.5 * budget_.work_left(), kept_work));
  const double to_verify =
      budget_.TakeWork(std::min(kShareOfPartial * budget_.work_left(), kWorkOfPartial));
  double places = budget_.TakeWork(kWorkOfPlaces);
  const auto few_spots = static_cast<size_t>(
      std::ranges::count_if(spots, [](const Spot& spot) { return !spot.is_half; }));
  const bool few = few_spots <= kFewThings && result().blobs.size() <= kFewThings;
  std::vector<Blob> parts;
  if (few) {
    for (const Spot& spot : spots) {
      if (!spot.is_half) parts.push_back(spot.blob);
    }
    for (const Blob& blob : result().blobs) parts.push_back(blob);
  }
  PartialWands found = FindPartialWands(image, wand_finder_, wholes, parts, kMaxPartial, &places,
                                        look_for_third, !without_.Has(WandMechanism::kStickSight));
  budget_.GiveBackWork(std::max(0.0, places) + to_verify);
  double work = budget_.TakeWork(kWorkOfLevel);
  standing_out_ = std::move(found.blobs);
  candidates_ = std::move(found.candidates);
  Verdict verdict = verifier_.Verify(image, standing_out_, wand_finder_, candidates_, tried_,
                                     IsLit(image), &work);
  budget_.GiveBackWork(work + kept);
  if (verdict.wand && (found.cut_short || verdict.measured < candidates_.size())) {
    // What was left out may be as good.
    const auto chosen = std::find_if(candidates_.begin(), candidates_.end(), [&](const auto& one) {
      return one.blobs == verdict.wand->blobs;
    });
    const double its_cost = std::min(chosen->cost, verdict.wand->cost);
    const bool is_rival = verdict.measured < candidates_.size() &&
                          candidates_[verdict.measured].cost < its_cost + kALittleWorse;
    const bool is_short = chosen->has_stick ? found.cut_stick : found.cut_short;
    if (is_rival || (is_short && its_cost > kSureCost)) verdict.wand.reset();
  }
  // Two things that only stand out are less than two of the wand's colour, however few there are.
  const double least =
      few && !look_for_third ? 0 : LeastPartialConfidence(found.tried, IsLit(image));
  if (verdict.wand &&
      (verdict.wand->confidence < least || verdict.wand->label_confidence < kPartialLabels)) {
    verdict.wand.reset();
  }
  if (verdict.wand && !verifier_.FitOutlines(image, &*verdict.wand)) verdict.wand.reset();
  if (verdict.wand) TryWhole(image, &*verdict.wand);
  if (!look_for_third) return verdict;
  // Of two that only stand out evidence alone does not say which markers they are.
  if (verdict.wand && !verifier_.IsByEvidence(*verdict.wand)) return verdict;
  return SearchThird(image, found.thirds, found.tried);
}

// A wand of two markers that were found and of one that was not, but is seen where they say.
Verdict WandSearch::SearchThird(const ImageView& image, absl::Span<const WandCandidate> thirds,
                                int places_tried) {
  double work = budget_.TakeWork(kWorkOfWhole);
  Verdict verdict = verifier_.Verify(image, standing_out_, wand_finder_,
                                     thirds.first(std::min(thirds.size(), kMostThirds)),
                                     tried_ + places_tried, IsLit(image), &work);
  budget_.GiveBackWork(work);
  if (!verdict.wand || verdict.ambiguous ||
      verdict.wand->confidence < LeastPartialConfidence(places_tried, IsLit(image)) ||
      verdict.wand->label_confidence < kPartialLabels ||
      !verifier_.FitOutlines(image, &*verdict.wand) || verdict.wand->OccludedCount() > 0) {
    return {};
  }
  return verdict;
}

void WandSearch::TryWhole(const ImageView& image, VerifiedWand* wand) {
  const auto whole = WholeCandidate(wand_finder_, *wand, &standing_out_);
  if (!whole) return;
  double work = budget_.TakeWork(kWorkOfWhole, kLeastWorkOfWhole);
  // Its labels are as certain as the other way round is worse.
  std::array<WandCandidate, 2> both = {*whole, *whole};
  std::ranges::reverse(both[1].blobs);
  Verdict verdict =
      verifier_.Verify(image, standing_out_, wand_finder_, both, tried_, IsLit(image), &work);
  budget_.GiveBackWork(work);
  if (!verdict.wand || verdict.wand->blobs != whole->blobs || verdict.wand->OccludedCount() > 0 ||
      verdict.wand->cost > wand->cost + kWholeGain ||
      verdict.wand->label_confidence < kPartialLabels) {
    return;
  }
  if (!verifier_.FitOutlines(image, &*verdict.wand)) return;
  if (verdict.wand->LargestSigmaRadii() < kKnownWhole) *wand = *std::move(verdict.wand);
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
