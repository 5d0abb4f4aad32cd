// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/lens_comparison.h"

#include <cmath>
#include <vector>

#include "server/solve/evaluate/kept_lenses.h"
#include "server/solve/evaluate/predicted_error.h"
#include "server/solve/evaluate/uncertainty.h"

namespace rigcal::server {
namespace {

double RootMeanSquare(const std::vector<double>& values) {
  double square = 0;
  for (const double value : values) square += value * value;
  return values.empty() ? 0 : std::sqrt(square / static_cast<double>(values.size()));
}

}  // namespace

bool LensComparison::RefinedIsNearer() const { return refined_m < given_m; }

std::optional<LensComparison> CompareLenses(const RigSolution& given, const RigSolution& refined,
                                            const RigSolveOptions& options) {
  RigSolveOptions with_given = options, with_refined = options;
  with_given.refine_intrinsics = false;
  with_refined.refine_intrinsics = true;
  const auto of_given = ComputeUncertainty(given, with_given);
  const auto of_refined = ComputeUncertainty(refined, with_refined);
  if (!of_given.ok() || !of_refined.ok()) return std::nullopt;
  const BundleProblem& problem = given.built.problem;
  const KeptLenses lenses = MeasureKeptLenses(problem.cameras, refined.built.problem, *of_refined,
                                              of_given->design_effect);
  LensComparison comparison;
  comparison.given_m = RootMeanSquare(PredictCentreSigmas(problem, *of_given, lenses, 1));
  comparison.refined_m =
      RootMeanSquare(PredictCentreSigmas(refined.built.problem, *of_refined, {}, 1));
  return comparison;
}

}  // namespace rigcal::server
