// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"
#include "server/solve/evaluate/held_out.h"
#include "server/solve/evaluate/held_out_choice.h"
#include "server/solve/evaluate/kept_lenses.h"
#include "server/solve/evaluate/lens_models.h"
#include "server/solve/evaluate/predicted_error.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

struct EvaluatedSolution {
  RigSolution solution;                       // of everything
  RigSolveOptions options;                    // as chosen
  std::optional<EvaluatedErrors> held_out;    // none: too little to hold anything out
  std::optional<RigUncertainty> uncertainty;  // none: the data leave something undetermined
  KeptLenses lenses_kept;                     // of given intrinsics that the solution keeps
  PredictedError predicted;
  // Refined intrinsics fit better between neighbouring times only: kept for that.
  bool refined_by_chance = false;
  // Of a path through time (trajectory_fit.h) over instants, on held-out blocks, where one was
  // tried.
  std::optional<HeldOutGain> path_gain;
  std::vector<BetterLens> lenses;  // that another model describes better than the given one
  std::vector<Finding> findings;   // about what was chosen, and why
};

// Solves the rig and cross-validates it: time is cut into blocks of 2 s with guards of 0.2 s, and
// every fourth block is held out of a solve and evaluated with it, four times, so that each block
// is evaluated once. A choice (`auto`) is made anew in each of the four folds, by two inner solves
// that hold out blocks of the rest in the same way; it never sees the fold's own blocks. The
// published solution uses all data, with the choice of the four folds together, which must also
// hold over long blocks of time (held_out_choice.h): else nothing is refined, in the folds neither.
// The solves of the folds begin at the estimates of the first solve and end, roughly, at the
// optimum of their own data, of which they use as much as their errors need (RigSolveOptions).
//
// Where residuals suspect the model of a lens, others are compared (lens_models.h) and named; the
// solution is that of the given ones.
//
// Line delays of rolling shutters are estimated where one stands out (line_delays.h), clock rates
// where at least one of them is significantly not zero.
// Where rows that no other camera shares are many, or as asked for, the target is followed through
// time (trajectory_fit.h) in the folds and in the end; kept, unless asked for, only where the
// held-out errors are not larger.
// The first solve begins at `given`, if not null. It is checked for clocks matched at a wrong
// offset (time_check.h) and for a wrong minimum (restart.h), and then by `check`, whose error is
// passed on: what cannot become right is not worth the rest.
absl::StatusOr<EvaluatedSolution> SolveAndEvaluate(
    const RigObservations& rig, const std::vector<ClockCorrection>& clocks,
    const RigSolveOptions& base, const CalibrationOptions& options,
    const RigInitialization* given = nullptr,
    const std::function<absl::Status(const RigSolution& solution)>& check = {});

}  // namespace rigcal::server
