// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/findings.h"

#include <algorithm>
#include <functional>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "server/solve/diagnose/clock_course.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/evaluate/quality_gate.h"

namespace rigcal::server {
namespace {

constexpr int kMaxRepairs = 8;
// By which one cause alone may fit worse than several with it.
constexpr double kFewerCausesWorth = 0.02;
// Explanations are compared on the same markers, outliers included, each of at most this error.
constexpr double kComparedCapPx = 60;
// A clock's course that takes away less of its cameras' mean error is none.
constexpr double kNoCoursePx = 0.02;

using RepairFunction = Repair (*)(const CauseInput&);
constexpr RepairFunction kRepairs[] = {RepairClocks, RepairIntrinsics,      RepairMovedCamera,
                                       RepairWand,   RepairRollingShutters, RepairClockCourse};
using CauseFunction = std::vector<Cause> (*)(const CauseInput&);
constexpr CauseFunction kCauses[] = {FindClockOffsets,     FindClockRates,     FindPriorIntrinsics,
                                     FindFarIntrinsics,    FindFlippedMarkers, FindWrongWandLength,
                                     FindWrongTargetShape, FindUnseenEdges,    FindWeakLinks,
                                     FindNarrowBaselines,  FindLoosePoses,     FindTooLittleData,
                                     FindOutliersInSpan,   FindOddCameras,     FindStampJitter,
                                     FindDisplacedMarkers, FindAbsences};

void Append(std::vector<Cause> from, std::vector<Cause>* to) {
  to->insert(to->end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

// A trial in which none of these clocks has a course that takes away anything.
bool RunsEvenly(const CauseInput& input, const TrialProblem& trial,
                const std::vector<int>& clocks) {
  return std::ranges::all_of(clocks, [&](int clock) {
    const auto course = MeasureClockCourse(input.rig, input.evaluated.solution, trial, clock);
    return course && (course->kind == CourseKind::kConstant || course->gain_px() < kNoCoursePx);
  });
}

// Where the last of several causes explains as much alone, the others were found because it had not
// been taken out yet. None where it does not. Behind a clock's course, whose paths leave out
// outliers, errors with them and without do not compare: there the clock must run evenly once the
// last cause alone is taken out.
std::optional<Repair> ExplainedAlone(const CauseInput& start, const Repair& last) {
  if (!last.on_other) return std::nullopt;
  Repair alone = last.on_other(start);
  if (alone.causes.empty()) return std::nullopt;
  if (!last.repaired.uneven_clocks.empty()) {
    if (!RunsEvenly(start, alone.repaired, last.repaired.uneven_clocks)) return std::nullopt;
    return alone;
  }
  const double both_px = CappedErrorPx(last.repaired.problem, kComparedCapPx);
  const double alone_px = CappedErrorPx(alone.repaired.problem, kComparedCapPx);
  if (alone_px > (1 + kFewerCausesWorth) * both_px) return std::nullopt;
  return alone;
}

// Takes out one cause after the other, the one that explains most first, until nothing is left that
// explains anything. `trial` is then solved without them.
Causes TakeOutCauses(const RigObservations& rig, const EvaluatedSolution& evaluated,
                     const CalibrationResult& result, TrialProblem* trial) {
  Causes found;
  const TrialProblem start = *trial;
  std::vector<RepairFunction> left(std::begin(kRepairs), std::end(kRepairs));
  for (int round = 0; round < kMaxRepairs; ++round) {
    Repair best;
    size_t best_function = 0;
    double best_gain_px = 0;
    const double before_px = CappedErrorPx(trial->problem, kComparedCapPx);
    for (size_t f = 0; f < left.size(); ++f) {
      Repair repair = left[f]({rig, evaluated, result, *trial});
      if (repair.causes.empty()) continue;
      const double same_rows_px =
          before_px - CappedErrorPx(repair.repaired.problem, kComparedCapPx);
      if (same_rows_px <= 0) continue;
      const double gain_px = repair.gain_px.value_or(same_rows_px);
      if (gain_px <= best_gain_px) continue;
      best_gain_px = gain_px;
      best = std::move(repair);
      best_function = f;
    }
    if (best.causes.empty()) break;
    const RepairFunction function = left[best_function];
    if (!found.causes.empty()) {
      if (auto alone = ExplainedAlone({rig, evaluated, result, start}, best)) {
        best = *std::move(alone);
        found = {};
        left.assign(std::begin(kRepairs), std::end(kRepairs));
      }
    }
    Append(std::move(best.causes), &found.causes);
    if (best.course) found.courses.push_back(*std::move(best.course));
    *trial = std::move(best.repaired);
    // Only cameras that moved are found one by one.
    if (function != RepairMovedCamera) std::erase(left, function);
  }
  return found;
}

// The cameras whose markers fit as those of a usable calibration do.
std::set<std::string> FittingCameras(const TrialProblem& trial) {
  const BundleProblem& problem = trial.problem;
  const std::vector<ErrorChange> errors = CompareErrors(problem, problem);
  std::vector<int> counts(problem.cameras.size(), 0);
  ForEachMarker(problem, [&](size_t, const BundleObservation& observation, size_t) {
    ++counts[static_cast<size_t>(observation.camera)];
  });
  std::set<std::string> fitting;
  for (const BundleCamera& camera : problem.cameras) fitting.insert(camera.name);
  // A camera that moved has several parts, all of which must fit.
  for (size_t c = 0; c < errors.size(); ++c) {
    const double outliers = 1 - static_cast<double>(errors[c].marker_count) /
                                    static_cast<double>(std::max(1, counts[c]));
    const bool fits = errors[c].before_px <= kQualityLimits.inlier_mean_px.usable &&
                      outliers <= kQualityLimits.outlier_share.usable;
    if (!fits) fitting.erase(problem.cameras[c].name);
  }
  return fitting;
}

// What is a cause of error, and not a fact about the recording or about what was chosen.
bool IsCauseOfError(FindingKind kind) {
  switch (kind) {
    case FindingKind::kClockOffset:
    case FindingKind::kClockJump:
    case FindingKind::kClockDrift:
    case FindingKind::kWrongIntrinsics:
    case FindingKind::kIntrinsicsFromPrior:
    case FindingKind::kCameraMoved:
    case FindingKind::kLensChanged:
    case FindingKind::kWandNotRigid:
    case FindingKind::kRollingShutter:
    case FindingKind::kFlippedLabels:
    case FindingKind::kWrongWandLength:
    case FindingKind::kWrongTargetShape:
    case FindingKind::kLoosePose:
      return true;
    default:
      return false;
  }
}

Finding AsCandidate(const Cause& cause) {
  Finding finding = cause.finding;
  finding.candidate = true;
  finding.value = cause.cost_px;
  finding.unit = "px";
  finding.advice = absl::StrFormat(
      "a possible cause, not a certain one: it would explain %.2f px of the mean error. The rest "
      "of the error is so large that its size cannot be told: remove what is certain first, and "
      "calibrate again",
      cause.cost_px);
  return finding;
}

// What a camera suffers from and what that looks like in the same camera, although the solve with
// the cause taken out no longer shows it: the lenses of the result were refined with the cause in.
struct Symptoms {
  std::vector<FindingKind> causes, symptoms;
};

const Symptoms kSymptoms[] = {
    // Rows whose times scatter look like noise, and like image rows taken one after the other.
    {{FindingKind::kStampsJitter}, {FindingKind::kRollingShutter, FindingKind::kNoisyCamera}},
    {{FindingKind::kCameraMoved, FindingKind::kLensChanged},
     {FindingKind::kIntrinsicsFromPrior, FindingKind::kWrongIntrinsics}},
};

// A clock whose rate was estimated with another cause of error in its camera may run as it should.
bool IsEstimatedRate(const Cause& cause) {
  return cause.finding.kind == FindingKind::kClockDrift && cause.finding.unit == "ppm";
}

void DropSymptoms(std::vector<Cause>* causes) {
  for (const Symptoms& known : kSymptoms) {
    std::set<std::string> cameras;
    for (const Cause& cause : *causes) {
      if (std::ranges::count(known.causes, cause.finding.kind) > 0) {
        cameras.insert(cause.finding.camera);
      }
    }
    std::erase_if(*causes, [&](const Cause& cause) {
      return std::ranges::count(known.symptoms, cause.finding.kind) > 0 &&
             cameras.contains(cause.finding.camera);
    });
  }
  std::set<std::string> spoilt;
  for (const Cause& cause : *causes) {
    if (IsCauseOfError(cause.finding.kind) && cause.finding.kind != FindingKind::kClockOffset &&
        !IsEstimatedRate(cause)) {
      spoilt.insert(cause.finding.camera);
    }
  }
  std::erase_if(*causes, [&](const Cause& cause) {
    return IsEstimatedRate(cause) && spoilt.contains(cause.finding.camera);
  });
}

}  // namespace

Causes FindCauses(const RigObservations& rig, const EvaluatedSolution& evaluated,
                  const CalibrationResult& result) {
  Causes found;
  TrialProblem trial = MakeTrialProblem(evaluated.solution, evaluated.options);
  if (SolveTrial(trial.bundle, &trial.problem).ok()) {
    found = TakeOutCauses(rig, evaluated, result, &trial);
    const bool explained = !found.causes.empty();
    found.fitting = FittingCameras(trial);
    for (const CauseFunction find : kCauses) {
      Append(find({rig, evaluated, result, trial}), &found.causes);
    }
    DropSymptoms(&found.causes);
    // More data would not mend what spoils those that are there.
    if (explained && evaluated.predicted.holds) {
      std::erase_if(found.causes, [](const Cause& cause) {
        return cause.finding.kind == FindingKind::kTooLittleData;
      });
    }
  }
  found.camera_count = rig.index.cameras.size();
  std::ranges::stable_sort(found.causes, std::greater(), &Cause::cost_px);
  for (const Finding& finding : evaluated.findings) found.causes.push_back({finding, 0});
  return found;
}

std::vector<Finding> FindingsOf(const Causes& causes, bool is_bad) {
  const auto holds = [&causes](const std::string& camera) {
    if (2 * causes.fitting.size() <= causes.camera_count) return false;
    return camera.empty() ? causes.fitting.size() == causes.camera_count
                          : causes.fitting.contains(camera);
  };
  std::vector<Finding> findings;
  for (const Cause& cause : causes.causes) {
    const bool doubtful = is_bad && !cause.certain && IsCauseOfError(cause.finding.kind) &&
                          !holds(cause.finding.camera);
    findings.push_back(doubtful ? AsCandidate(cause) : cause.finding);
  }
  return findings;
}

}  // namespace rigcal::server
