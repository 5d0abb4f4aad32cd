// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"
#include "server/solve/calibrate.h"
#include "server/solve/rig/held_rig.h"
#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

// What a look at a rig solves, to be compared with its calibration (CompareRigs): a what-if with
// the lenses of the calibration. An error of a lens moves both alike.
CalibrationOptions LookOptions(const CalibrationResult& active);

// Changes the input of a solve as its options ask: leaves out cameras, sessions and times, takes
// the assumed target, and the intrinsics that are given or, of a repair or refinement, the
// parent's.
// INVALID_ARGUMENT: a named camera or session is not there. FAILED_PRECONDITION: intrinsics are for
// another image size; the wand of another number of markers; the parent is missing.
absl::Status ApplyDerivation(const CalibrationOptions& options, CalibrationInput* input);

// Of a repair or refinement: the camera whose frame the solve is in: the parent's reference camera,
// or else the first one that is not repaired. Else that of the options.
std::string ReferenceOf(const CalibrationOptions& options, const CalibrationInput& input);

// Whether all cameras, but those of a repair, are where the parent has them; `now` is a solve of
// the same observations that holds none. FAILED_PRECONDITION: names those that are not, and by how
// much.
absl::Status CheckOthersStayed(const CalibrationOptions& options, const CalibrationResult& parent,
                               const CalibrationResult& now);

// Of a repair: the poses of the cameras that are not repaired, with their covariance for the
// reference camera (ReferenceOf, as it is in the options) held fixed, or, where the parent has a
// frame of its own, as it is. Null for other kinds of solve.
// FAILED_PRECONDITION: fewer than two cameras are held; the parent has no covariance or no scale.
absl::StatusOr<std::shared_ptr<const HeldRig>> HeldRigOf(const CalibrationOptions& options,
                                                         const CalibrationResult* parent,
                                                         const RigIndex& index);

}  // namespace rigcal::server
