// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"
#include "common/calibration/calibration_stage.h"
#include "server/associate/camera_track.h"

namespace rigcal::server {

struct EvaluatedSolution;
struct RigObservations;
struct RigSolution;

struct CalibrationInput {
  Target target;                    // of the sessions that other_targets does not name
  std::vector<CameraTrack> tracks;  // in any order
  std::vector<Refusal> refused;     // by the agents and by ingest: carried over into the result
  std::map<std::string, Target> other_targets = {};  // by session
  std::optional<CalibrationResult> parent = {};      // where CalibrationOptions::kind needs one
};

struct CalibrationHooks {
  // Called from time to time from the solving thread: the stage and how much of it is done, 0 to 1.
  std::function<void(CalibrationStage stage, double fraction)> progress;
  // Called from the waiting thread where another process solves: true when it stops giving signs of
  // life, false when it gives them again.
  std::function<void(bool not_responding)> silence;
  // Looked at between iterations; true ends the solve with CANCELLED.
  const std::atomic<bool>* cancelled = nullptr;
  // Called once from the solving thread with the solve that is published, before it is returned:
  // every marker with what became of it, and the problem whose information is the covariance
  // (line_bundle.h).
  std::function<void(const RigObservations& rig, const RigSolution& solution)> solved;
  // Called beside `solved`, with what is known of the errors of that solve.
  std::function<void(const RigObservations& rig, const EvaluatedSolution& evaluated)> evaluated;
};

struct CalibrationOutcome {
  absl::StatusOr<CalibrationResult> result;
  std::vector<Refusal> refused;  // what was left out, also when the solve failed
  // The observations could not be read because the store could not be reached: nothing was solved.
  bool store_was_gone = false;
};

// The whole solve: sort, associate, start, bundle adjustment, residuals. Depends on the set of
// observations only, not on their order; bit for bit on one build and CPU. Knows no files, no
// network.
//
// Errors of `result`: INVALID_ARGUMENT (options, a known distance with a wand, a camera without
// intrinsics), FAILED_PRECONDITION (not connected, with no group of three: names the groups and
// the pair that would best join them; too few instants; no camera; targets that do not go
// together), CANCELLED. Each says what to do.
//
// One camera that agrees with no pose among the others, in a rig of four and more, is left out: a
// finding names it, its rows are counted in `refused`, and the result is that of the others.
//
// Of cameras that are not connected, the largest group of three or more is calibrated (that of the
// reference camera where one was asked for); each of the others has a finding `weak_link` with what
// to do.
//
// The rows of `input` are freed as soon as they have been read.
CalibrationOutcome Calibrate(CalibrationInput input, const CalibrationOptions& options,
                             const CalibrationHooks& hooks = {});

}  // namespace rigcal::server
