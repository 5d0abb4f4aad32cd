// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/fold_evaluation.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "server/solve/evaluate/path_choice.h"

namespace rigcal::server {
namespace {

// Share of the placed instants that a fold leaves out before it is thinned.
double LeftOutOf(const RigSolution& solution, const TimeBlocks& blocks, int fold) {
  double all = 0, kept = 0;
  for (size_t i = 0; i < solution.built.problem.instants.size(); ++i) {
    if (!solution.built.problem.instants[i].used) continue;
    ++all;
    kept += blocks.IsKept(solution.built.instant_time_ns[i], fold) ? 1 : 0;
  }
  return all > 0 ? 1 - kept / all : 0;
}

void Append(const EvaluatedErrors& from, EvaluatedErrors* to) {
  const auto append = [](const std::vector<std::vector<double>>& source, auto* target) {
    target->resize(source.size());
    for (size_t i = 0; i < source.size(); ++i) {
      (*target)[i].insert((*target)[i].end(), source[i].begin(), source[i].end());
    }
  };
  append(from.reprojection_px, &to->reprojection_px);
  append(from.leave_one_out_px, &to->leave_one_out_px);
  append(from.lengths, &to->lengths);
  to->instant_count += from.instant_count;
}

}  // namespace

absl::StatusOr<FoldResults> EvaluateFolds(const RigObservations& rig,
                                          const RigInitialization& initial,
                                          const RigSolution& solution, const TimeBlocks& blocks,
                                          const RigSolveOptions& base,
                                          const std::vector<bool>& refine_in_fold,
                                          bool tries_path) {
  FoldResults results;
  const int block_count =
      CountBlocks(blocks, *std::ranges::max_element(solution.built.instant_time_ns));
  std::vector<EvaluatedErrors> before, after;  // by held-out block
  for (int fold = 0; fold < blocks.period; ++fold) {
    RigSolveOptions options =
        OptionsOfFold(rig, base, [&blocks, fold](int64_t t) { return blocks.IsKept(t, fold); });
    options.progress = ProgressAs(CalibrationStage::kEvaluating, base);
    if (!refine_in_fold.empty()) {
      options.refine_intrinsics = refine_in_fold[static_cast<size_t>(fold)];
    }
    if (tries_path) options.max_observations = 0;
    absl::StatusOr<RigSolution> solved = SolveFold(rig, initial, options);
    if (absl::IsCancelled(solved.status())) return solved.status();
    if (!solved.ok()) continue;
    const auto is_held_out = [&blocks, fold](int64_t t) { return blocks.IsHeldOut(t, fold); };
    const absl::StatusOr<EvaluatedErrors> errors =
        EvaluateHeldOut(rig, *solved, options, 0, is_held_out);
    if (!errors.ok()) continue;
    Append(*errors, &results.by_instants.held_out);
    results.by_instants.poses.push_back(FoldPosesOf(rig.index, *solved, solution));
    results.by_instants.poses.back().left_out = LeftOutOf(solution, blocks, fold);
    if (!tries_path) continue;
    absl::StatusOr<PathFold> path =
        FollowInFold(rig, options, blocks, fold, block_count, results.path.get(), &*solved);
    if (absl::IsCancelled(path.status())) return path.status();
    if (!path.ok()) continue;
    const absl::StatusOr<EvaluatedErrors> path_errors =
        EvaluateHeldOut(rig, path->solution, options, 0, is_held_out);
    if (!path_errors.ok()) continue;
    results.path = path->solution.trajectory;
    Append(*path_errors, &results.by_path.held_out);
    results.by_path.poses.push_back(FoldPosesOf(rig.index, path->solution, solution));
    results.by_path.poses.back().left_out = results.by_instants.poses.back().left_out;
    std::ranges::move(path->before, std::back_inserter(before));
    std::ranges::move(path->after, std::back_inserter(after));
  }
  results.path_gain = CompareVariants(before, after);
  return results;
}

}  // namespace rigcal::server
