// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/findings.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "server/solve/diagnose/finding_causes.h"

namespace rigcal::server {
namespace {

constexpr int kMaxRepairs = 8;

using RepairFunction = Repair (*)(const CauseInput&);
constexpr RepairFunction kRepairs[] = {RepairClocks, RepairIntrinsics, RepairMovedCamera,
                                       RepairRollingShutters};
using CauseFunction = std::vector<Cause> (*)(const CauseInput&);
constexpr CauseFunction kCauses[] = {FindClockOffsets,    FindFarIntrinsics, FindFlippedMarkers,
                                     FindWrongWandLength, FindUnseenEdges,   FindWeakLinks,
                                     FindNarrowBaselines, FindLoosePoses};

void Append(std::vector<Cause> from, std::vector<Cause>* to) {
  to->insert(to->end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

// Takes out one cause after the other, the one that explains most first, until nothing is left that
// explains anything. `trial` is then solved without them.
std::vector<Cause> TakeOutCauses(const RigObservations& rig, const EvaluatedSolution& evaluated,
                                 const CalibrationResult& result, TrialProblem* trial) {
  std::vector<Cause> causes;
  std::vector<RepairFunction> left(std::begin(kRepairs), std::end(kRepairs));
  for (int round = 0; round < kMaxRepairs; ++round) {
    Repair best;
    size_t best_function = 0;
    double best_gain_px = 0;
    for (size_t f = 0; f < left.size(); ++f) {
      Repair repair = left[f]({rig, evaluated, result, *trial});
      if (repair.causes.empty()) continue;
      const double gain_px =
          Overall(CompareErrors(trial->problem, repair.repaired.problem)).gain_px();
      if (gain_px <= best_gain_px) continue;
      best_gain_px = gain_px;
      best = std::move(repair);
      best_function = f;
    }
    if (best.causes.empty()) break;
    Append(std::move(best.causes), &causes);
    *trial = std::move(best.repaired);
    // Only cameras that moved are found one by one.
    if (left[best_function] != RepairMovedCamera) {
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(best_function));
    }
  }
  return causes;
}

}  // namespace

std::vector<Finding> FindCauses(const RigObservations& rig, const EvaluatedSolution& evaluated,
                                const CalibrationResult& result) {
  std::vector<Cause> causes;
  TrialProblem trial = MakeTrialProblem(evaluated.solution, evaluated.options);
  if (SolveTrial(trial.bundle, &trial.problem).ok()) {
    causes = TakeOutCauses(rig, evaluated, result, &trial);
    for (const CauseFunction find : kCauses) Append(find({rig, evaluated, result, trial}), &causes);
  }
  std::ranges::stable_sort(causes, std::greater(), &Cause::cost_px);
  std::vector<Finding> findings;
  for (Cause& cause : causes) findings.push_back(std::move(cause.finding));
  findings.insert(findings.end(), evaluated.findings.begin(), evaluated.findings.end());
  return findings;
}

}  // namespace rigcal::server
