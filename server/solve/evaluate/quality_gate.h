// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "common/calibration/calibration.h"
#include "server/solve/evaluate/predicted_error.h"

namespace rigcal::server {

// A grade below which a limit is passed. Each figure of the calibration has two limits: up to
// `good` it is no reason against `good`, up to `usable` none against `usable`, above it is `bad`.
struct QualityLimit {
  double good = 0;
  double usable = 0;
};

// Limits of each figure and their reasons. Errors are held-out ones.
struct QualityLimits {
  // Mean held-out reprojection error of a camera. Centres are detected to 0.3 to 0.5 px, which
  // gives a mean of 0.4 to 0.6 px; three times that is a model that does not describe the camera.
  QualityLimit held_out_mean_px = {0.7, 2};
  // Mean leave-one-camera-out error: the camera's own noise and that of the point the others
  // triangulate, 1.4 to 2 times the reprojection error on a sound rig.
  QualityLimit leave_one_out_mean_px = {1.2, 3};
  // Without anything held out: mean error of the inliers that were solved for, which flatters.
  QualityLimit inlier_mean_px = {0.6, 1.5};
  // Rejected markers. Reflections cause some; beyond a third the outlier rule is unreliable.
  QualityLimit outlier_share = {0.1, 0.35};
  // Held-out error of a span against the length of the whole wand. 0.3 px at 3 m and a focal length
  // of 1000 px are 1 mm, 0.3 % of a wand of 0.4 m.
  QualityLimit length_error_rel = {0.006, 0.02};
  // Predicted error (one sigma) by what is accepted: an error of two sigmas is accepted, and of
  // one.
  QualityLimit predicted_error = {0.5, 1};
  // Held-out errors (markers) of a camera below which they are ignored.
  uint32_t min_held_out_count = 60;
};
inline constexpr QualityLimits kQualityLimits;

// How a finding limits the grade of `result`: kError makes it bad, kWarning usable at most.
FindingSeverity SeverityOf(const CalibrationResult& result, const Finding& finding);

// Grades a reported calibration by the limits, by its predicted error and by its findings:
//   bad     a limit for `usable` is passed; the predicted error is larger than what is accepted, or
//           there is too little data to predict it; a camera moved while it was recorded: its pose
//           is that of neither time; the wand's spans contradict each other by more than what is
//           accepted
//   usable  a limit for `good` is passed, nothing could be held out or too little of a camera, or
//           a finding names what the solve has not taken out (wrong_intrinsics and clock_offset
//           where these were kept as given, rolling_shutter whose line delay is not estimated,
//           wrong_wand_length, wrong_target_shape, weak_link,
//           narrow_baseline, loose_pose)
//   good    otherwise
// The reasons are those for the grade, by camera, with figure and limit; for `good` they are the
// worst figures.
//
// `predicted`: none where it is not known, and then no reason against any grade.
Quality GradeQuality(const CalibrationResult& result,
                     const std::optional<PredictedError>& predicted = std::nullopt);

// The limits for `usable` are passed, or the uncertainty does not hold: whatever its findings are,
// the figures of this result are not to be believed.
bool IsBadByFigures(const CalibrationResult& result,
                    const std::optional<PredictedError>& predicted = std::nullopt);

}  // namespace rigcal::server
