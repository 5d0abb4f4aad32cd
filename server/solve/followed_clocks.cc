// SPDX-License-Identifier: Apache-2.0
#include "server/solve/followed_clocks.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/time/clock_course.h"

namespace rigcal::server {
namespace {

constexpr int kMaxCourseRounds = 3;
// Of a clock that is followed: what its camera's error must lose, and another one's may gain.
constexpr double kMinCourseGain = 0.05, kMayLose = 0.05;
constexpr double kOutlierPx = 10;
constexpr double kFewLost = 0.02;  // of a camera's markers

// Markers of a camera that took part in the solve.
double MarkerCount(const CalibratedCamera& camera) {
  return camera.residuals.outlier_count + camera.residuals.inlier.marker_count;
}

// Mean held-out error of a camera with so many markers; what is no inlier, an outlier or a part of
// no instant, as the 10 px beyond which it says nothing. A few of these at the ends of the
// recording and of the image say nothing either.
double ErrorOfAllPx(const CalibratedCamera& camera, double marker_count) {
  const double lost = 1 - camera.residuals.inlier.marker_count / std::max(1.0, marker_count);
  const double counted = std::max(0.0, lost - kFewLost);
  const double mean_px =
      camera.held_out ? camera.held_out->mean_px : camera.residuals.inlier.mean_px;
  return (1 - counted) * mean_px + counted * kOutlierPx;
}

// One camera clearly, and no other one worse. Both results have the same cameras.
bool FitsBetter(const CalibrationResult& before, const CalibrationResult& after,
                const std::string& camera) {
  if (before.cameras.size() != after.cameras.size()) return false;
  for (size_t c = 0; c < before.cameras.size(); ++c) {
    const double count = std::max(MarkerCount(before.cameras[c]), MarkerCount(after.cameras[c]));
    const double before_px = ErrorOfAllPx(before.cameras[c], count);
    const double after_px = ErrorOfAllPx(after.cameras[c], count);
    const double most_px = before.cameras[c].camera == camera ? (1 - kMinCourseGain) * before_px
                                                              : (1 + kMayLose) * before_px;
    if (!(after_px <= most_px)) return false;
  }
  return true;
}

// The same rows, their times moved along the course of their clock.
RigObservations WithCourse(RigObservations rig, const FoundCourse& course) {
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    if (rig.index.clock_of_track[t] != course.clock) continue;
    rig.tracks[t].clock_course = Sum(rig.tracks[t].clock_course, course.line);
  }
  return rig;
}

}  // namespace

absl::Status FollowClocks(const std::vector<ClockCorrection>& clocks,
                          const CalibrationOptions& options, const CalibrationHooks& hooks,
                          const std::map<std::string, CameraCounts>& counts,
                          const RefusalCounter& refused, const std::shared_ptr<const HeldRig>& held,
                          RigObservations* rig, Solved* solved, std::vector<Finding>* followed) {
  if (options.time_offsets == Estimate::kFixed) return absl::OkStatus();
  for (int round = 0; round < kMaxCourseRounds && !solved->courses.empty(); ++round) {
    const FoundCourse course = solved->courses.front();
    if (!KeepsOrder(course.line)) break;
    RigObservations changed = WithCourse(*rig, course);
    absl::StatusOr<Solved> again =
        SolveAndReport(changed, clocks, SolveOptionsOf(changed, options, hooks, counts, held),
                       options, counts, refused);
    if (absl::IsCancelled(again.status())) return again.status();
    if (!again.ok() || !FitsBetter(solved->result, again->result, course.finding.camera)) break;
    followed->push_back(course.finding);
    absl::StrAppend(&followed->back().advice,
                    "; the calibration follows it (the camera's `clock_course`). Another recording "
                    "has another course: look for what makes the clock do so");
    *solved = *std::move(again);
    *rig = std::move(changed);
  }
  return absl::OkStatus();
}

}  // namespace rigcal::server
