// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "common/calibration/calibration.h"
#include "server/solve/diagnose/findings.h"
#include "server/solve/diagnose/trial_solve.h"
#include "server/solve/evaluate/evaluated_solve.h"

namespace rigcal::server {

struct CauseInput {
  const RigObservations& rig;
  const EvaluatedSolution& evaluated;
  const CalibrationResult& result;
  const TrialProblem& trial;  // solved
};

// An explanation of the residuals, put into effect.
struct Repair {
  std::vector<Cause> causes;  // none: it explains nothing
  TrialProblem repaired;      // solved with these causes taken out
  // Of the mean error of all markers, where the trial does not show what is gained.
  std::optional<double> gain_px;
  std::optional<FoundCourse> course;  // of a clock
  // The same explanation put into effect on another trial, whether or not it would be found there.
  std::function<Repair(const CauseInput&)> on_other;
};

// Explanations compete: wrong intrinsics look like a camera that moved where the wand was elsewhere
// before and after, and the other way round. The one that takes away most goes first, and the
// others are tried on what is left.
Repair RepairClocks(const CauseInput& input);       // where offsets were kept as given
Repair RepairIntrinsics(const CauseInput& input);   // kept as given, or held by their priors
Repair RepairMovedCamera(const CauseInput& input);  // one camera at a time
Repair RepairWand(const CauseInput& input);         // that bends, sags or whose marker slips
Repair RepairRollingShutters(const CauseInput& input);
Repair RepairClockCourse(const CauseInput& input);  // of the one clock that pulls most

// What was found and taken out by the solve itself, and what is no matter of the residuals.
std::vector<Cause> FindClockOffsets(const CauseInput& input);
std::vector<Cause> FindClockRates(const CauseInput& input);  // far from the others', and estimated
std::vector<Cause> FindFarIntrinsics(const CauseInput& input);
std::vector<Cause> FindPriorIntrinsics(const CauseInput& input);
std::vector<Cause> FindFlippedMarkers(const CauseInput& input);
std::vector<Cause> FindWrongWandLength(const CauseInput& input);
std::vector<Cause> FindWrongTargetShape(const CauseInput& input);  // of a rigid target
std::vector<Cause> FindUnseenEdges(const CauseInput& input);
std::vector<Cause> FindAbsences(const CauseInput& input);  // cameras without rows for seconds
std::vector<Cause> FindWeakLinks(const CauseInput& input);
std::vector<Cause> FindNarrowBaselines(const CauseInput& input);
std::vector<Cause> FindLoosePoses(const CauseInput& input);
std::vector<Cause> FindTooLittleData(const CauseInput& input);
std::vector<Cause> FindOutliersInSpan(const CauseInput& input);
std::vector<Cause> FindOddCameras(const CauseInput& input);
// Of one camera, while the target itself is whole.
std::vector<Cause> FindDisplacedMarkers(const CauseInput& input);
// Before rolling shutters and noisy cameras, which it looks like; of those that times are estimated
// of.
std::vector<Cause> FindStampJitter(const CauseInput& input);

}  // namespace rigcal::server
