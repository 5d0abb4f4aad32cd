// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/intrinsics_choice.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "server/solve/evaluate/held_out_choice.h"
#include "server/solve/evaluate/lens_fit.h"
#include "server/solve/evaluate/placed_views.h"
#include "server/solve/rig/intrinsics_prior.h"

namespace rigcal::server {
namespace {

// That a choice is evaluated on.
constexpr size_t kChoiceObservations = 10'000;
// A refinement must make the held-out error smaller by this share to be kept.
constexpr double kMustGain = 0.02;
// And by so many standard errors over long blocks of time.
constexpr double kChoiceSigmas = 2;
constexpr int kMinLongBlocks = 4;
constexpr int kMinBlockInstants = 10;  // fewer say nothing of a whole block
// Of a camera that is chosen for by itself: among hundreds chance gives some of them two.
constexpr double kOwnChoiceSigmas = 3;
constexpr size_t kMostChoiceGroups = 12, kMinGroupViews = 10, kMostChoiceViews = 200;
// Of a rejected marker, which wrong intrinsics may have put there.
constexpr double kMayBeLensPx = 60;

// Held-out errors of the two ways to treat intrinsics, summed over the folds that had both.
struct IntrinsicsScores {
  double given_px = 0;
  double refined_px = 0;
  int folds = 0;

  bool RefinedPays() const { return folds > 0 && refined_px < (1 - kMustGain) * given_px; }
  void Add(const IntrinsicsScores& other) {
    given_px += other.given_px;
    refined_px += other.refined_px;
    folds += other.folds;
  }
};

// For each fold, within what it leaves: two solves without the blocks of another fold, evaluated on
// those. Of two folds that leave out each other's blocks, the solves are the same.
absl::StatusOr<std::vector<IntrinsicsScores>> ScoreIntrinsics(const RigObservations& rig,
                                                              const RigInitialization& initial,
                                                              const TimeBlocks& blocks,
                                                              const RigSolveOptions& base) {
  std::vector<IntrinsicsScores> scores(static_cast<size_t>(blocks.period));
  const int apart = blocks.period / 2;
  for (int a = 0; a < apart; ++a) {
    const int b = a + apart;
    // By fold, by whether intrinsics are refined.
    double score_px[2][2] = {{INFINITY, INFINITY}, {INFINITY, INFINITY}};
    for (const bool refine : {false, true}) {
      RigSolveOptions options = OptionsOfFold(rig, base, [&blocks, a, b](int64_t t) {
        return blocks.IsKept(t, a) && blocks.IsKept(t, b);
      });
      options.refine_intrinsics = refine;
      options.progress = ProgressAs(CalibrationStage::kChoosingIntrinsics, base);
      const absl::StatusOr<RigSolution> solution = SolveFold(rig, initial, options);
      if (absl::IsCancelled(solution.status())) return solution.status();
      if (!solution.ok()) continue;
      for (const bool second : {false, true}) {
        const int outer = second ? b : a, inner = second ? a : b;
        const absl::StatusOr<EvaluatedErrors> errors = EvaluateHeldOut(
            rig, *solution, options, kChoiceObservations, [&blocks, outer, inner](int64_t t) {
              return blocks.IsHeldOut(t, inner) && blocks.IsKept(t, outer);
            });
        if (errors.ok()) score_px[second][refine] = ChoiceScorePx(*errors);
      }
    }
    for (const bool second : {false, true}) {
      const auto& [given_px, refined_px] = score_px[second];
      if (!std::isfinite(given_px) || !std::isfinite(refined_px)) continue;
      scores[static_cast<size_t>(second ? b : a)] = {given_px, refined_px, 1};
    }
  }
  return scores;
}

// Refined intrinsics that pay between neighbouring times, over long blocks: given ones before,
// refined ones after. None where there are too few blocks, or a variant could not be solved.
absl::StatusOr<std::optional<HeldOutGain>> CompareOverLongBlocks(const RigObservations& rig,
                                                                 const RigInitialization& initial,
                                                                 const RigSolution& solution,
                                                                 const RigSolveOptions& base) {
  const auto& times_ns = solution.built.instant_time_ns;
  const auto [first, last] = std::ranges::minmax_element(times_ns);
  const TimeBlocks blocks = LongBlocks(*first, *last);
  const int count = CountBlocks(blocks, *last);
  if (count < kMinLongBlocks) return std::nullopt;
  std::vector<SolveVariant> variants(2, {&rig, &initial, base});
  for (const bool refine : {false, true}) {
    RigSolveOptions& options = variants[refine ? 1 : 0].options;
    options.refine_intrinsics = refine;
    options.progress = ProgressAs(CalibrationStage::kChoosingIntrinsics, base);
  }
  RIGCAL_ASSIGN_OR_RETURN(auto errors, EvaluateVariants(variants, blocks, count));
  for (std::vector<EvaluatedErrors>& by_block : errors) {
    for (EvaluatedErrors& block : by_block) {
      if (block.instant_count < kMinBlockInstants) block = {};
    }
  }
  if (errors[0].empty() || errors[1].empty()) return std::nullopt;
  const HeldOutGain gain = CompareVariants(errors[0], errors[1]);
  if (gain.blocks < kMinLongBlocks) return std::nullopt;
  return gain;
}

Finding KeptFinding(const IntrinsicsScores& scores, const HeldOutGain& gain) {
  return {FindingKind::kIntrinsicsKept, "", gain.before_px, "px",
          absl::StrFormat(
              "held-out error over %d long blocks of time %.3f px with the given intrinsics, %.3f "
              "px with refined ones, which differ by no more than chance (one sigma %.3f px); "
              "between neighbouring times %.3f and %.3f px. The given ones are used",
              gain.blocks, gain.before_px, gain.after_px, gain.sigma_px,
              scores.given_px / scores.folds, scores.refined_px / scores.folds)};
}

Finding IntrinsicsFinding(const IntrinsicsScores& scores) {
  const bool pays = scores.RefinedPays();
  const double given_px = scores.given_px / scores.folds;
  const double refined_px = scores.refined_px / scores.folds;
  return {pays ? FindingKind::kIntrinsicsRefined : FindingKind::kIntrinsicsKept, "",
          pays ? refined_px : given_px, "px",
          absl::StrFormat("held-out error %.3f px with the given intrinsics, %.3f px with refined "
                          "ones; the %s are used",
                          given_px, refined_px, pays ? "refined ones" : "given ones")};
}

// Where too little data is there to hold any out.
Finding UncheckedFinding() {
  return {FindingKind::kIntrinsicsKept, "", 0, "px",
          "too little data to check refined intrinsics; the given ones are kept. Record longer, "
          "or ask for refinement"};
}

}  // namespace

absl::StatusOr<IntrinsicsChoice> ChooseIntrinsics(const RigObservations& rig,
                                                  const RigInitialization& initial,
                                                  const RigSolution& solution,
                                                  const TimeBlocks& blocks,
                                                  const RigSolveOptions& base) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<IntrinsicsScores> of_fold,
                          ScoreIntrinsics(rig, initial, blocks, base));
  IntrinsicsScores scores;
  IntrinsicsChoice choice;
  for (const IntrinsicsScores& own : of_fold) {
    scores.Add(own);
    choice.refine_in_fold.push_back(own.RefinedPays());
  }
  if (scores.folds == 0) {
    choice.finding = UncheckedFinding();
    return choice;
  }
  choice.refine = scores.RefinedPays();
  choice.given_px = scores.given_px / scores.folds;
  choice.finding = IntrinsicsFinding(scores);
  if (!choice.refine) return choice;
  // What does not hold over long blocks is refined in no fold.
  RIGCAL_ASSIGN_OR_RETURN(const std::optional<HeldOutGain> gain,
                          CompareOverLongBlocks(rig, initial, solution, base));
  if (!gain || gain->IsClear(kMustGain, kChoiceSigmas)) return choice;
  choice.refine = false;
  choice.refined_by_chance = true;
  choice.refine_in_fold.assign(of_fold.size(), false);
  choice.finding = KeptFinding(scores, *gain);
  return choice;
}

IntrinsicsChoice ChooseIntrinsicsByCamera(const RigObservations& rig, const BundleProblem& problem,
                                          const RigSolveOptions& base, int folds) {
  const size_t count = problem.cameras.size();
  const auto is_new = [&base](size_t c) { return c < base.new_lens.size() && base.new_lens[c]; };
  IntrinsicsChoice choice;
  choice.keep = base.keep_intrinsics;
  choice.keep.resize(count, false);
  const std::vector<bool> asked_to_keep = choice.keep;
  std::vector<bool> may_change(count);
  for (size_t c = 0; c < count; ++c) may_change[c] = !choice.keep[c] && !is_new(c);
  const auto views = PlaceByOthers(problem, may_change, kMostChoiceViews, kMayBeLensPx);
  std::vector<double> given_px, refined_px;  // by camera with enough views
  size_t refined = 0;
  for (size_t c = 0; c < count; ++c) {
    if (!may_change[c]) continue;
    choice.keep[c] = true;
    const auto groups =
        static_cast<int>(std::min(kMostChoiceGroups, views[c].size() / kMinGroupViews));
    if (groups < kMinLongBlocks) continue;
    BundleCamera camera = problem.cameras[c];
    camera.intrinsics_fixed = true;
    const std::vector<double> before = HeldOutErrorsPx(views[c], camera, groups);
    SetIntrinsicsPrior(rig.index.cameras[c], &camera);
    const HeldOutGain gain = CompareByBlock(before, HeldOutErrorsPx(views[c], camera, groups));
    if (gain.blocks < kMinLongBlocks) continue;
    given_px.push_back(gain.before_px);
    refined_px.push_back(gain.after_px);
    choice.keep[c] = !gain.IsClear(kMustGain, kOwnChoiceSigmas);
    refined += choice.keep[c] ? 0 : 1;
  }
  if (given_px.empty()) {
    choice.refine_in_fold.assign(static_cast<size_t>(folds), false);
    choice.finding = UncheckedFinding();
    return choice;
  }
  const HeldOutGain together = CompareByBlock(given_px, refined_px);
  if (together.IsClear(kMustGain, kChoiceSigmas)) {
    choice.keep = asked_to_keep;
    refined = static_cast<size_t>(std::ranges::count(may_change, true));
  }
  choice.refine = refined > 0;
  choice.refine_in_fold.assign(static_cast<size_t>(folds), choice.refine);
  choice.given_px = together.before_px;
  choice.finding = {
      choice.refine ? FindingKind::kIntrinsicsRefined : FindingKind::kIntrinsicsKept, "",
      choice.refine ? together.after_px : together.before_px, "px",
      absl::StrFormat("held-out error of a camera, mean of %d, where the others place the target: "
                      "%.3f px with the given intrinsics, %.3f px with refined ones; refined ones "
                      "are used for %d of %d cameras, and the given ones for the others",
                      given_px.size(), together.before_px, together.after_px, refined, count)};
  return choice;
}

void KeepGiven(const LensComparison& lenses, IntrinsicsChoice* choice) {
  choice->refine = false;
  choice->refine_in_fold.assign(choice->refine_in_fold.size(), false);
  const std::string fit = std::move(choice->finding.advice);
  choice->finding = {
      FindingKind::kIntrinsicsKept, "", choice->given_px, "px",
      absl::StrFormat("%s; but the data tell so little about the lenses that with these the "
                      "cameras would be placed %.1f times as far off as with the given ones, which "
                      "are used",
                      fit.substr(0, fit.find(';')), lenses.refined_m / lenses.given_m)};
}

}  // namespace rigcal::server
