// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/target/observation.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/calibrate.h"

namespace rigcal::accuracy {

// Rows that are taken as one instant, with the number of each one's track.
using PairedRows = std::vector<std::pair<int, const Observation*>>;

// Starting values from the rows alone: relative poses of pairs of cameras, chained from the first
// track's, whose frame is the rig's (server/solve/initialize). Every centre has a weight of 1 / px;
// spans or points, intrinsics and clocks are as given.
//
// Errors of FindInitialization; INVALID_ARGUMENT: a camera without intrinsics, names it.
absl::StatusOr<server::BundleProblem> StartFromPairs(const server::CalibrationInput& input,
                                                     const std::vector<PairedRows>& instants);

// A calibration of the tracks' cameras with the poses of `problem`, in the order of its cameras;
// their lenses and clocks as given, without residuals.
CalibrationResult ResultOf(const server::CalibrationInput& input,
                           const server::BundleProblem& problem);

}  // namespace rigcal::accuracy
