// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/camera/camera_model.h"
#include "server/solve/diagnose/clock_course.h"
#include "server/solve/diagnose/finding_causes.h"

namespace rigcal::server {
namespace {

// Of the camera's mean error, that the course takes away.
constexpr double kMinCourseGainPx = 0.02;
constexpr double kVelocityStepS = 0.002;
constexpr size_t kMaxCourses = 3;
// Outliers, of which a course's path leaves some out, count no more.
constexpr double kErrorCapPx = 3;

// Those that take away most of their cameras' errors, the largest first.
std::vector<ClockCourse> WorstCourses(const CauseInput& input) {
  std::vector<ClockCourse> courses;
  const auto count = static_cast<int>(input.evaluated.solution.clocks.size());
  for (int k = 0; k < count; ++k) {
    std::optional<ClockCourse> course =
        MeasureClockCourse(input.rig, input.evaluated.solution, input.trial, k);
    if (!course || course->kind == CourseKind::kConstant) continue;
    if (course->gain_px() >= kMinCourseGainPx) courses.push_back(*std::move(course));
  }
  std::ranges::stable_sort(courses, std::greater(), &ClockCourse::gain_px);
  if (courses.size() > kMaxCourses) courses.resize(kMaxCourses);
  return courses;
}

// The camera's markers as it saw them at the times that the course says.
void MoveMarkers(const CauseInput& input, const ClockCourse& course, TrialProblem* trial) {
  const auto t = static_cast<size_t>(course.track);
  const int clock = input.rig.index.clock_of_track[t];
  const auto camera = static_cast<size_t>(input.rig.index.camera_of_track[t]);
  const Intrinsics& given = *input.rig.index.cameras[camera].intrinsics;
  const int64_t origin_ns = input.evaluated.solution.built.instant_time_ns.front();
  BundleProblem& problem = trial->problem;
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const double time_s = 1e-9 * static_cast<double>(trial->instant_time_ns[i] - origin_ns);
    const double seen_s = time_s - course.OffsetAt(time_s);
    const BundleInstant& instant = problem.instants[i];
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      if (observation.clock != clock ||
          trial->rig_camera[static_cast<size_t>(observation.camera)] != camera) {
        continue;
      }
      for (BundleMarker& marker : problem.MarkersOf(observation)) {
        const int label = marker.marker - problem.target.WandOf(marker.marker).first;
        const RayPath& path = course.paths.markers[static_cast<size_t>(label)];
        const auto pixel = [&](double at_s) -> std::optional<Eigen::Vector2d> {
          const auto ray = At(path, at_s, course.paths.gap_s);
          Eigen::Vector2d seen_px;
          if (!ray || !Project(given, ray->homogeneous(), &seen_px)) return std::nullopt;
          return seen_px;
        };
        const auto now = pixel(seen_s);
        const auto later = pixel(seen_s + kVelocityStepS), earlier = pixel(seen_s - kVelocityStepS);
        if (!now || !later || !earlier) continue;
        marker.centre_px = *now;
        marker.velocity_px_s = (*later - *earlier) / (2 * kVelocityStepS);
      }
    }
  }
  problem.clocks[static_cast<size_t>(clock)].time_offset_s = 0;
  problem.clocks[static_cast<size_t>(clock)].time_rate = 0;
}

// Of all markers.
double ShareOf(const BundleProblem& problem, size_t camera) {
  double own = 0, all = 0;
  ForEachMarker(problem, [&](size_t, const BundleObservation& observation, size_t) {
    own += static_cast<size_t>(observation.camera) == camera ? 1 : 0;
    ++all;
  });
  return own / std::max(1.0, all);
}

// By how much its stamps change at a step: an offset that grows makes them too early.
const char* SenseOf(const ClockStep& step) { return step.size_s < 0 ? "later" : "earlier"; }

std::string DescribeSteps(const ClockCourse& course) {
  std::string what;
  if (course.steps.size() == 1) {
    const ClockStep& step = course.steps.front();
    what = absl::StrFormat(
        "%.1f s after the first wand view its clock jumped by %.2f ms (+-%.2f ms): its stamps are "
        "that much %s from then on",
        step.time_s, 1e3 * std::abs(step.size_s), 1e3 * step.sigma_s, SenseOf(step));
  } else {
    what = absl::StrFormat("its clock jumped %d times, seconds after the first wand view: ",
                           course.steps.size());
    const auto describe = [](std::string* out, const ClockStep& step) {
      absl::StrAppendFormat(out, "at %.1f s its stamps become %.2f ms (+-%.2f ms) %s", step.time_s,
                            1e3 * std::abs(step.size_s), 1e3 * step.sigma_s, SenseOf(step));
    };
    absl::StrAppend(&what, absl::StrJoin(course.steps, ", ", describe));
  }
  return absl::StrFormat(
      "%s; its error is %.2f px, and %.2f px with an offset of its own before and after", what,
      course.before_px, course.after_px);
}

std::string DescribeDrift(const ClockCourse& course) {
  const double span_s = course.blocks.back().time_s - course.blocks.front().time_s;
  std::string how = "its rate changes, and one rate does not describe it";
  if (course.kind == CourseKind::kSlope) {
    how = absl::StrFormat("it runs %.0f ppm %s than what the calibration assumes",
                          1e6 * std::abs(course.coefficients[1]),
                          course.coefficients[1] < 0 ? "faster" : "slower");
  } else if (course.kind == CourseKind::kCorners) {
    const auto describe = [](std::string* out, const ClockCorner& corner) {
      absl::StrAppendFormat(out, "%.1f s after the first wand view it becomes %.0f ppm %s",
                            corner.time_s, 1e6 * std::abs(corner.slope),
                            corner.slope < 0 ? "faster" : "slower");
    };
    how = absl::StrJoin(course.corners, ", ", describe);
  }
  return absl::StrFormat(
      "its clock drifts by %.2f ms (+-%.2f ms) over %.0f s: %s; its error is %.2f px, and %.2f px "
      "with this drift",
      1e3 * std::abs(course.size_s), 1e3 * course.sigma_s, span_s, how, course.before_px,
      course.after_px);
}

constexpr char kStepAdvice[] =
    ". Look for lost frames, a clock that was set, or a driver that was restarted, and record "
    "again, or calibrate from what was recorded on one side of the jump";
constexpr char kDriftAdvice[] =
    ". Let its stamps come from a clock that is disciplined, or use a common trigger, and check "
    "whether they are times of arrival";

}  // namespace

Repair RepairClockCourse(const CauseInput& input) {
  Repair repair;
  // One clock that is off pulls at the others, which then seem to have a course, too: the one with
  // which all cameras fit best.
  std::optional<ClockCourse> course;
  double least_px = std::numeric_limits<double>::infinity();
  for (ClockCourse& candidate : WorstCourses(input)) {
    TrialProblem repaired = input.trial;
    MoveMarkers(input, candidate, &repaired);
    if (!SolveTrialFromAfar(input.trial.bundle, &repaired.problem).ok()) continue;
    const double error_px = CappedErrorPx(repaired.problem, kErrorCapPx);
    if (error_px >= least_px) continue;
    least_px = error_px;
    course = std::move(candidate);
    repair.repaired = std::move(repaired);
  }
  if (!course) return repair;
  const auto t = static_cast<size_t>(course->track);
  const auto camera = static_cast<size_t>(input.rig.index.camera_of_track[t]);
  repair.repaired.uneven_clocks.push_back(input.rig.index.clock_of_track[t]);
  const bool step = course->kind == CourseKind::kSteps;
  const FindingKind kind = step ? FindingKind::kClockJump : FindingKind::kClockDrift;
  const std::string& name = input.rig.index.cameras[camera].camera;
  const std::string what = step ? DescribeSteps(*course) : DescribeDrift(*course);
  if (!course->line.empty()) {
    repair.course = {input.rig.index.clock_of_track[t],
                     std::move(course->line),
                     {kind, name, 1e3 * course->size_s, "ms", what}};
  }
  repair.causes.push_back({{kind, name, 1e3 * course->size_s, "ms",
                            absl::StrCat(what, step ? kStepAdvice : kDriftAdvice)},
                           course->gain_px()});
  // Rows that are in no instant are missing in the trial, and what they gain with them. Outliers
  // that the path leaves out are no gain of the course.
  repair.gain_px = course->gain_px() * ShareOf(input.trial.problem, camera);
  return repair;
}

}  // namespace rigcal::server
