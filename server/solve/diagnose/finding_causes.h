// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/calibration/calibration.h"
#include "server/solve/diagnose/trial_solve.h"
#include "server/solve/evaluate/evaluated_solve.h"

namespace rigcal::server {

// One cause of error with what it costs, by which causes are sorted.
struct Cause {
  Finding finding;
  double cost_px = 0;  // mean error of the camera (or of all) that goes away when it is removed
};

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
};

// Explanations compete: wrong intrinsics look like a camera that moved where the wand was elsewhere
// before and after, and the other way round. The one that takes away most goes first, and the
// others are tried on what is left.
Repair RepairClocks(const CauseInput& input);       // where offsets were kept as given
Repair RepairIntrinsics(const CauseInput& input);   // where they were kept as given
Repair RepairMovedCamera(const CauseInput& input);  // one camera at a time
Repair RepairRollingShutters(const CauseInput& input);

// What was found and taken out by the solve itself, and what is no matter of the residuals.
std::vector<Cause> FindClockOffsets(const CauseInput& input);
std::vector<Cause> FindFarIntrinsics(const CauseInput& input);
std::vector<Cause> FindFlippedMarkers(const CauseInput& input);
std::vector<Cause> FindWrongWandLength(const CauseInput& input);
std::vector<Cause> FindUnseenEdges(const CauseInput& input);
std::vector<Cause> FindWeakLinks(const CauseInput& input);
std::vector<Cause> FindNarrowBaselines(const CauseInput& input);
std::vector<Cause> FindLoosePoses(const CauseInput& input);

}  // namespace rigcal::server
