// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/held_out_choice.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/solve/rig/put_away.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {
namespace {

// Of a fold, or so many of each camera: enough for the cameras' parameters to add less than a
// hundredth to the errors.
constexpr size_t kFoldObservations = 10'000;
constexpr size_t kFoldViews = 200;
constexpr int64_t kMinLongBlockNs = 2'000'000'000;
constexpr int kLongBlocks = 12;
constexpr int kMinComparedBlocks = 4;
constexpr int kMinHeldOutInstants = 20;

// In standard deviations.
double SignedRanks(std::vector<double> differences) {
  std::ranges::sort(differences, {}, [](double difference) { return std::abs(difference); });
  const double n = static_cast<double>(differences.size());
  double positive = 0;
  for (size_t i = 0; i < differences.size(); ++i) {
    if (differences[i] > 0) positive += static_cast<double>(i) + 1;
  }
  return (positive - n * (n + 1) / 4) / std::sqrt(n * (n + 1) * (2 * n + 1) / 24);
}

}  // namespace

RigSolveOptions OptionsOfFold(const RigObservations& rig, RigSolveOptions options,
                              std::function<bool(int64_t)> keep) {
  options.keep_instant = std::move(keep);
  options.max_observations = std::max(kFoldObservations, kFoldViews * rig.index.cameras.size());
  options.rough = true;
  return options;
}

absl::StatusOr<RigSolution> SolveFold(const RigObservations& rig, const RigInitialization& initial,
                                      const RigSolveOptions& options) {
  absl::StatusOr<RigSolution> solution = SolveRig(rig, initial.clocks, options, &initial);
  // The evaluation builds a problem of its own.
  if (solution.ok()) PutAway(rig, options, &*solution);
  return solution;
}

std::function<void(CalibrationStage, double)> ProgressAs(CalibrationStage stage,
                                                         const RigSolveOptions& options) {
  if (!options.progress) return {};
  return [progress = options.progress, stage](CalibrationStage, double fraction) {
    progress(stage, fraction);
  };
}

absl::StatusOr<EvaluatedErrors> EvaluateHeldOut(const RigObservations& rig,
                                                const RigSolution& solution,
                                                RigSolveOptions options, size_t max_observations,
                                                const std::function<bool(int64_t)>& select) {
  options.max_observations = max_observations;
  EvaluatedErrors errors = EvaluateSolution(rig, solution, options, select);
  if (errors.instant_count < kMinHeldOutInstants) {
    return absl::FailedPreconditionError("too few instants are held out");
  }
  return errors;
}

TimeBlocks LongBlocks(int64_t first_ns, int64_t last_ns) {
  TimeBlocks blocks;
  blocks.origin_ns = first_ns;
  blocks.block_ns = std::max(kMinLongBlockNs, (last_ns - first_ns) / kLongBlocks + 1);
  blocks.period = 2;
  return blocks;
}

int CountBlocks(const TimeBlocks& blocks, int64_t last_ns) {
  return static_cast<int>(blocks.Block(last_ns)) + 1;
}

absl::StatusOr<std::vector<std::vector<EvaluatedErrors>>> EvaluateVariants(
    const std::vector<SolveVariant>& variants, const TimeBlocks& blocks, int count) {
  std::vector<std::vector<EvaluatedErrors>> errors(variants.size());
  for (size_t v = 0; v < variants.size(); ++v) {
    const SolveVariant& variant = variants[v];
    errors[v].resize(static_cast<size_t>(count));
    for (int fold = 0; fold < blocks.period; ++fold) {
      const RigSolveOptions options =
          OptionsOfFold(*variant.rig, variant.options,
                        [&blocks, fold](int64_t t) { return blocks.IsKept(t, fold); });
      const absl::StatusOr<RigSolution> solution =
          SolveFold(*variant.rig, *variant.initial, options);
      if (absl::IsCancelled(solution.status())) return solution.status();
      if (!solution.ok()) {
        errors[v].clear();
        break;
      }
      std::vector<EvaluatedErrors> parts =
          EvaluateParts(*variant.rig, *solution, options, count, [&blocks, fold](int64_t t) {
            return blocks.IsHeldOut(t, fold) ? static_cast<int>(blocks.Block(t)) : -1;
          });
      for (int part = 0; part < count; ++part) {
        if (part % blocks.period != fold) continue;
        errors[v][static_cast<size_t>(part)] = std::move(parts[static_cast<size_t>(part)]);
      }
    }
  }
  return errors;
}

bool HeldOutGain::IsClear(double share, double sigmas) const {
  return blocks >= kMinComparedBlocks && after_px < (1 - share) * before_px &&
         (before_px - after_px > sigmas * sigma_px || rank_sigmas > sigmas);
}

HeldOutGain CompareByBlock(const std::vector<double>& before_px,
                           const std::vector<double>& after_px) {
  HeldOutGain gain;
  double square = 0;
  std::vector<double> differences;
  for (size_t b = 0; b < std::min(before_px.size(), after_px.size()); ++b) {
    if (!std::isfinite(before_px[b]) || !std::isfinite(after_px[b])) continue;
    gain.before_px += before_px[b];
    gain.after_px += after_px[b];
    square += (before_px[b] - after_px[b]) * (before_px[b] - after_px[b]);
    differences.push_back(before_px[b] - after_px[b]);
    ++gain.blocks;
  }
  if (gain.blocks == 0) return gain;
  gain.rank_sigmas = SignedRanks(std::move(differences));
  const double n = gain.blocks;
  gain.before_px /= n;
  gain.after_px /= n;
  const double mean = gain.before_px - gain.after_px;
  if (gain.blocks > 1) {
    gain.sigma_px = std::sqrt(std::max(0.0, square - n * mean * mean) / (n * (n - 1)));
  }
  return gain;
}

HeldOutGain CompareVariants(const std::vector<EvaluatedErrors>& before,
                            const std::vector<EvaluatedErrors>& after) {
  std::vector<double> before_px, after_px;
  for (const EvaluatedErrors& errors : before) before_px.push_back(ChoiceScorePx(errors));
  for (const EvaluatedErrors& errors : after) after_px.push_back(ChoiceScorePx(errors));
  return CompareByBlock(before_px, after_px);
}

}  // namespace rigcal::server
