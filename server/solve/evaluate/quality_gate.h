// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/calibration/calibration.h"

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
  // Held-out errors (markers) of a camera below which they are ignored.
  uint32_t min_held_out_count = 60;
};
inline constexpr QualityLimits kQualityLimits;

// How a finding limits the grade of `result`: kError makes it bad, kWarning usable at most.
FindingSeverity SeverityOf(const CalibrationResult& result, const Finding& finding);

// Grades a reported calibration by the limits and by its findings:
//   bad     a limit for `usable` is passed, or a camera moved while it was recorded: its pose is
//           that of neither time
//   usable  a limit for `good` is passed, nothing could be held out or too little of a camera, or
//           a finding names what the solve has not taken out (wrong_intrinsics and clock_offset
//           where these were kept as given, rolling_shutter, wrong_wand_length, weak_link,
//           narrow_baseline, loose_pose)
//   good    otherwise
// The reasons are those for the grade, by camera, with figure and limit; for `good` they are the
// worst figures.
Quality GradeQuality(const CalibrationResult& result);

}  // namespace rigcal::server
