// SPDX-License-Identifier: Apache-2.0
#include "server/solve/calibrate.h"

#include <algorithm>
#include <exception>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/time/clock_course.h"
#include "server/associate/stamp_units.h"
#include "server/associate/static_points.h"
#include "server/solve/calibration_report.h"
#include "server/solve/clocks/time_search.h"
#include "server/solve/derivation.h"
#include "server/solve/diagnose/odd_camera.h"
#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/evaluate/parameter_information.h"
#include "server/solve/evaluate/pose_covariance.h"
#include "server/solve/evaluate/pose_prior.h"
#include "server/solve/evaluate/quality_gate.h"
#include "server/solve/evaluate/restart.h"
#include "server/solve/frame_derivation.h"
#include "server/solve/input_checks.h"
#include "server/solve/kept_frame.h"
#include "server/solve/rig/held_rig.h"
#include "server/solve/time_search_report.h"

namespace rigcal::server {
namespace {

constexpr int kMaxLensRounds = 3, kMaxCourseRounds = 3;
// Sigma, as a share of a known distance, with which the solver holds it.
constexpr double kDistanceHold = 1e-4;
// Of a clock that is followed: what its camera's error must lose, and another one's may gain.
constexpr double kMinCourseGain = 0.05, kMayLose = 0.05;
constexpr double kOutlierPx = 10;

// 0 for none.
int CameraIndex(const RigIndex& index, const std::string& name) {
  const auto found = std::ranges::find(index.cameras, name, &CameraDescription::camera);
  return found == index.cameras.end() ? 0 : static_cast<int>(found - index.cameras.begin());
}

// Markers of a camera that took part in the solve.
double MarkerCount(const CalibratedCamera& camera) {
  return camera.residuals.outlier_count + camera.residuals.inlier.marker_count;
}

// Mean held-out error of a camera with so many markers; what is no inlier, an outlier or a part of
// no instant, as the 10 px beyond which it says nothing.
double ErrorOfAllPx(const CalibratedCamera& camera, double marker_count) {
  const double share = camera.residuals.inlier.marker_count / std::max(1.0, marker_count);
  const double mean_px =
      camera.held_out ? camera.held_out->mean_px : camera.residuals.inlier.mean_px;
  return share * mean_px + (1 - share) * kOutlierPx;
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

// A mirrored image fits with no pose: told before everything is tried on it.
absl::Status CheckMirrored(const RigObservations& rig, const RigSolution& solution) {
  const BundleProblem& problem = solution.built.problem;
  const std::vector<int> doubted = MeasureAgreement(problem).doubted;
  if (doubted.empty() || 2 * doubted.size() > problem.cameras.size()) return absl::OkStatus();
  const OddCamera odd =
      JudgeCamera(rig, solution, problem.cameras[static_cast<size_t>(doubted.front())].name);
  if (odd.kind != FindingKind::kMirroredImage) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat("camera ", odd.camera, ": ", odd.advice));
}

// From the clocks as the search leaves them; where that cannot be solved, from the clocks as given:
// a search that went wrong must not cost a rig that was aligned.
absl::StatusOr<EvaluatedSolution> SearchAndSolve(const RigObservations& rig,
                                                 const std::vector<ClockCorrection>& clocks,
                                                 const RigSolveOptions& solve,
                                                 const CalibrationOptions& options) {
  const auto check = [&rig](const RigSolution& solution) { return CheckMirrored(rig, solution); };
  if (!solve.estimate_time_offsets) {
    return SolveAndEvaluate(rig, clocks, solve, options, nullptr, check);
  }
  const auto progress = [&solve](double fraction) {
    solve.progress(CalibrationStage::kSearchingTimeOffsets, fraction);
  };
  std::vector<ClockCorrection> found = clocks;
  TimeSearchOutcome searched;
  RIGCAL_RETURN_IF_ERROR(SearchTimeOffsets(rig, solve.reference_camera, {progress, solve.cancelled},
                                           &found, &searched));
  RIGCAL_RETURN_IF_ERROR(CheckDecided(rig, searched));
  absl::StatusOr<EvaluatedSolution> evaluated =
      SolveAndEvaluate(rig, found, solve, options, nullptr, check);
  if (evaluated.ok()) AddSearchFindings(rig, searched, &evaluated->findings);
  const bool moved = !std::equal(found.begin(), found.end(), clocks.begin(),
                                 [](const ClockCorrection& a, const ClockCorrection& b) {
                                   return a.time_offset_s == b.time_offset_s;
                                 });
  if (!absl::IsFailedPrecondition(evaluated.status())) return evaluated;
  if (moved) {
    absl::StatusOr<EvaluatedSolution> as_given =
        SolveAndEvaluate(rig, clocks, solve, options, nullptr, check);
    if (as_given.ok() || absl::IsCancelled(as_given.status())) return as_given;
  }
  if (searched.period_s > 0) return WithPeriod(evaluated.status(), searched.period_s);
  return evaluated;
}

bool KeepsIntrinsics(const CalibrationOptions& options, const std::string& camera) {
  return std::ranges::find(options.fixed_intrinsics, camera) != options.fixed_intrinsics.end();
}

RigSolveOptions SolveOptionsOf(const RigObservations& rig, const CalibrationOptions& options,
                               const CalibrationHooks& hooks,
                               const std::map<std::string, CameraCounts>& counts,
                               std::shared_ptr<const HeldRig> held = nullptr) {
  RigSolveOptions solve;
  solve.held = std::move(held);
  solve.reference_camera = CameraIndex(rig.index, options.reference_camera);
  solve.estimate_time_offsets = options.time_offsets != Estimate::kFixed;
  solve.estimate_marker_positions =
      options.marker_positions != Estimate::kFixed && rig.Parts().HasLengths();
  if (options.known_distance) {
    const KnownDistance& known = *options.known_distance;
    solve.known_distance = BundleDistance{CameraIndex(rig.index, known.camera_a),
                                          CameraIndex(rig.index, known.camera_b), known.distance_m,
                                          kDistanceHold * known.distance_m};
    solve.known_distance_sigma_m = known.SigmaM();
  }
  solve.sigma_px = options.sigma_px;
  solve.tolerance_s = options.association_tolerance_s;
  solve.seed = options.seed;
  solve.progress = [&hooks](CalibrationStage stage, double fraction) {
    if (hooks.progress) hooks.progress(stage, fraction);
  };
  solve.cancelled = hooks.cancelled;
  for (const CameraDescription& camera : rig.index.cameras) {
    solve.camera_notes.push_back(absl::StrCat(counts.at(camera.camera).wand_count, " wand views"));
    solve.keep_intrinsics.push_back(KeepsIntrinsics(options, camera.camera));
  }
  return solve;
}

// A calibration before it is published.
struct Solved {
  EvaluatedSolution evaluated;
  CalibrationResult result;
  RefusalCounter refused;            // what was left out by it, and before
  std::vector<FoundCourse> courses;  // of clocks, that it does not follow
};

absl::StatusOr<Solved> SolveAndReport(const RigObservations& rig,
                                      const std::vector<ClockCorrection>& clocks,
                                      const RigSolveOptions& solve,
                                      const CalibrationOptions& options,
                                      const std::map<std::string, CameraCounts>& counts,
                                      const RefusalCounter& refused) {
  Solved solved;
  RIGCAL_ASSIGN_OR_RETURN(solved.evaluated, SearchAndSolve(rig, clocks, solve, options));
  solve.progress(CalibrationStage::kReporting, 1);
  solved.refused = refused;
  RIGCAL_ASSIGN_OR_RETURN(solved.result, ReportCalibration({rig, solved.evaluated, options, counts},
                                                           &solved.refused, &solved.courses));
  return solved;
}

// The one camera that spoils a rig: it cannot be solved with it, or agrees with no pose of it.
OddCamera SpoilingCamera(const absl::StatusOr<Solved>& solved, const RigObservations& rig,
                         const std::vector<ClockCorrection>& clocks, const RigSolveOptions& solve) {
  if (absl::IsFailedPrecondition(solved.status())) return FindOddCamera(rig, clocks, solve);
  OddCamera odd;
  if (!solved.ok()) return odd;
  int count = 0;
  for (const Finding& finding : solved->result.findings) {
    if (finding.candidate || (finding.kind != FindingKind::kInconsistentCamera &&
                              finding.kind != FindingKind::kMirroredImage)) {
      continue;
    }
    ++count;
    odd.camera = finding.camera;
    odd.kind = finding.kind;
    odd.error_px = finding.value;
    odd.advice = finding.advice;
  }
  return count == 1 ? odd : OddCamera{};
}

// Named by the options, it cannot be left out.
bool IsNeeded(const std::string& camera, const CalibrationOptions& options) {
  return camera == options.reference_camera ||
         (options.known_distance && (camera == options.known_distance->camera_a ||
                                     camera == options.known_distance->camera_b));
}

// The rig without the camera that spoils it. An error: that is not to be solved either.
absl::StatusOr<Solved> SolveWithout(const OddCamera& odd, RigObservations* rig,
                                    const std::vector<ClockCorrection>& clocks,
                                    const CalibrationOptions& options,
                                    const CalibrationHooks& hooks,
                                    const std::map<std::string, CameraCounts>& counts,
                                    RefusalCounter refused) {
  std::vector<ClockCorrection> remaining;
  RigObservations rest = WithoutCamera(
      *rig, clocks, static_cast<size_t>(CameraIndex(rig->index, odd.camera)), &remaining);
  refused.Add(odd.camera, RefusalReason::kOutlier, counts.at(odd.camera).wand_count,
              "the whole camera was left out (see findings)");
  RIGCAL_ASSIGN_OR_RETURN(
      Solved solved, SolveAndReport(rest, remaining, SolveOptionsOf(rest, options, hooks, counts),
                                    options, counts, refused));
  Finding finding{
      odd.kind, odd.camera, odd.error_px, "px",
      absl::StrCat("it was left out, and the calibration is that of the others: ", odd.advice)};
  finding.severity = SeverityOf(solved.result, finding);
  solved.result.findings.insert(solved.result.findings.begin(), std::move(finding));
  *rig = std::move(rest);
  return solved;
}

// The same rows, their times moved along the course of their clock.
RigObservations WithCourse(RigObservations rig, const FoundCourse& course) {
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    if (rig.index.clock_of_track[t] != course.clock) continue;
    rig.tracks[t].clock_course = Sum(rig.tracks[t].clock_course, course.line);
  }
  return rig;
}

// Follows clocks that jumped or drifted, one after the other, where they are for the solve to
// find, as long as held-out data say that they fit better so. What was followed is appended to
// `followed`. CANCELLED.
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

// With the lenses that the data prefer, where the intrinsics are for the solve to choose: in
// rounds, because one lens that is described wrongly spoils the errors of the others. What cannot
// be solved with them stays as it was. CANCELLED.
absl::Status ChooseLenses(const std::vector<ClockCorrection>& clocks,
                          const CalibrationOptions& options, const CalibrationHooks& hooks,
                          const std::map<std::string, CameraCounts>& counts,
                          const RefusalCounter& refused, RigObservations* rig, Solved* solved,
                          std::vector<Finding>* chosen) {
  if (options.intrinsics != Estimate::kDefault && options.intrinsics != Estimate::kAuto) {
    return absl::OkStatus();
  }
  std::vector<bool> new_lens(rig->index.cameras.size(), false);
  for (int round = 0; round < kMaxLensRounds; ++round) {
    std::vector<BetterLens> lenses = solved->evaluated.lenses;
    std::erase_if(lenses, [&](const BetterLens& lens) {
      return !lens.is_clear || KeepsIntrinsics(options, rig->index.cameras[lens.camera].camera);
    });
    if (lenses.empty()) break;
    RigObservations changed = WithLenses(*rig, lenses);
    RigSolveOptions solve = SolveOptionsOf(changed, options, hooks, counts);
    for (const BetterLens& lens : lenses) new_lens[lens.camera] = true;
    solve.new_lens = new_lens;
    absl::StatusOr<Solved> again = SolveAndReport(changed, clocks, solve, options, counts, refused);
    if (absl::IsCancelled(again.status())) return again.status();
    if (!again.ok()) break;
    for (const BetterLens& lens : lenses) chosen->push_back(FindingOf(*rig, lens, true));
    *solved = *std::move(again);
    *rig = std::move(changed);
  }
  return absl::OkStatus();
}

// What was chosen may cap the grade: a lens that only these data describe is at most usable.
void AddFindings(std::vector<Finding> findings, Solved* solved) {
  if (findings.empty()) return;
  CalibrationResult& result = solved->result;
  for (Finding& finding : findings) {
    finding.severity = SeverityOf(result, finding);
    result.findings.push_back(std::move(finding));
  }
  result.quality = GradeQuality(result, solved->evaluated.predicted);
}

// The same with the parent's poses as a prior.
absl::Status Refine(const RigObservations& rig, const CalibrationOptions& options,
                    const CalibrationResult& parent,
                    const std::map<std::string, CameraCounts>& counts,
                    const RefusalCounter& refused, Solved* solved) {
  RIGCAL_RETURN_IF_ERROR(CheckOthersStayed(options, parent, solved->result));
  const bool with_lenses = options.intrinsics == Estimate::kRefined;
  RIGCAL_ASSIGN_OR_RETURN(RigPoses prior,
                          PosesOf(parent, {}, with_lenses ? LensRows::kOwn : LensRows::kInPoses));
  if (const int fixed = prior.Find(options.reference_camera); fixed >= 0) {
    HoldFixed(static_cast<size_t>(fixed), &prior);
    MoveToFrameOf(
        static_cast<size_t>(fixed),
        solved->evaluated.solution.built.problem
            .cameras[static_cast<size_t>(CameraIndex(rig.index, options.reference_camera))]
            .cam_from_rig,
        &prior);
  }
  RIGCAL_RETURN_IF_ERROR(AddPosePrior(rig, prior, &solved->evaluated));
  solved->refused = refused;
  RIGCAL_ASSIGN_OR_RETURN(
      solved->result, ReportCalibration({rig, solved->evaluated, options, counts}, &solved->refused,
                                        &solved->courses));
  return absl::OkStatus();
}

// A full solve in the frame that the options ask for; a refinement in that of its parent where that
// is not a reference camera's.
absl::StatusOr<CalibrationResult> InFrame(CalibrationResult result,
                                          const CalibrationOptions& options,
                                          const std::optional<CalibrationResult>& parent) {
  const bool has_own = parent && parent->frame && parent->frame->IsOwn();
  if (options.kind == SolveKind::kRepair) {
    if (has_own) result.frame = InheritedFrame(*parent, options.parent_id);
    return result;
  }
  const bool must_keep =
      options.kind == SolveKind::kRefine ? has_own : options.frame == FrameChoice::kKeep;
  if (!must_keep && options.frame != FrameChoice::kKeepIfPossible) return result;
  absl::StatusOr<CalibrationResult> kept =
      parent ? KeepFrame(*parent, options.parent_id, result)
             : absl::NotFoundError(absl::StrCat("calibration ", options.parent_id,
                                                ", whose frame was to be kept, is not there"));
  if (kept.ok() || must_keep) return kept;
  result.frame.emplace();
  result.frame->source = FrameSource::kNotKept;
  result.frame->calibration_id = options.parent_id;
  result.frame->problem = std::string(kept.status().message());
  return result;
}

// Lenses that the parent has refined itself go on with its covariance; others stay as they are.
void FreeRefinedLenses(const CalibrationResult& parent, const CalibrationInput& input,
                       CalibrationOptions* options) {
  std::set<std::string> kept;
  bool any = false;
  for (const CameraTrack& track : input.tracks) {
    const std::string& name = track.camera.camera;
    const auto known = std::ranges::find(parent.cameras, name, &CalibratedCamera::camera);
    const bool is_free = known != parent.cameras.end() && known->intrinsics_refined &&
                         !KeepsIntrinsics(*options, name);
    any |= is_free;
    if (!is_free) kept.insert(name);
  }
  if (!any) return;
  options->intrinsics = Estimate::kRefined;
  options->fixed_intrinsics.assign(kept.begin(), kept.end());
}

// With the defaults of its kind: a repair keeps the parent's intrinsics, a refinement those that
// the parent has not refined itself.
CalibrationOptions WithDefaults(CalibrationOptions options, const CalibrationInput& input) {
  options.reference_camera = ReferenceOf(options, input);
  if (options.kind != SolveKind::kFull && options.intrinsics == Estimate::kDefault) {
    options.intrinsics = Estimate::kFixed;
    if (options.kind == SolveKind::kRefine && input.parent) {
      FreeRefinedLenses(*input.parent, input, &options);
    }
  }
  // What the parent knows is added to a solve by instants.
  if (options.kind != SolveKind::kFull) options.trajectory = TrajectoryChoice::kInterpolated;
  return options;
}

// What is published: in its frame, with what holds its parameters.
absl::StatusOr<CalibrationResult> Finish(const RigObservations& rig,
                                         const CalibrationOptions& options,
                                         const std::optional<CalibrationResult>& parent,
                                         Solved* solved) {
  RIGCAL_ASSIGN_OR_RETURN(CalibrationResult result,
                          InFrame(std::move(solved->result), options, parent));
  const Eigen::Matrix3d axes = result.frame && result.frame->IsOwn()
                                   ? result.frame->new_from_rig.rotation.toRotationMatrix()
                                   : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  result.information = MeasureInformation(rig, solved->evaluated.solution, axes);
  return result;
}

absl::StatusOr<CalibrationResult> Run(CalibrationInput& input, const CalibrationOptions& asked,
                                      const CalibrationHooks& hooks, RefusalCounter* refused) {
  RIGCAL_RETURN_IF_ERROR(asked.Validate());
  if (ChangesFrameOnly(asked.kind)) return DeriveFrame(&input, asked, refused);
  RIGCAL_RETURN_IF_ERROR(ApplyDerivation(asked, &input));
  const CalibrationOptions options = WithDefaults(asked, input);
  RIGCAL_RETURN_IF_ERROR(ValidateInput(input, options));
  const auto progress = [&hooks](CalibrationStage stage, double fraction) {
    if (hooks.progress) hooks.progress(stage, fraction);
  };
  progress(CalibrationStage::kAssociating, 0);
  const std::map<std::string, CameraCounts> counts = CountInput(input);
  RIGCAL_RETURN_IF_ERROR(CheckCameras(counts, options));
  RIGCAL_RETURN_IF_ERROR(CheckStampUnits(input.tracks));
  RigObservations rig;
  rig.target = input.target;
  rig.other_targets = input.other_targets;
  const auto target_of = [&rig](const std::string& session_id) -> const Target& {
    return rig.TargetOf(session_id);
  };
  rig.tracks = AlignTracks(&input.tracks, target_of, refused);
  std::vector<ClockCorrection> clocks;
  rig.index = IndexRig(rig.tracks, &clocks);
  RIGCAL_RETURN_IF_ERROR(CheckTracks(rig.index, counts));
  RIGCAL_RETURN_IF_ERROR(CheckMotion(rig));

  RigSolveOptions solve = SolveOptionsOf(rig, options, hooks, counts);
  absl::StatusOr<Solved> solved = SolveAndReport(rig, clocks, solve, options, counts, *refused);
  RIGCAL_ASSIGN_OR_RETURN(const std::shared_ptr<const HeldRig> held,
                          HeldRigOf(options, input.parent ? &*input.parent : nullptr, rig.index));
  OddCamera odd;
  if (held != nullptr) {
    RIGCAL_RETURN_IF_ERROR(solved.status());
    RIGCAL_RETURN_IF_ERROR(CheckOthersStayed(options, *input.parent, solved->result));
    solve = SolveOptionsOf(rig, options, hooks, counts, held);
    solved = SolveAndReport(rig, clocks, solve, options, counts, *refused);
  } else if (options.kind == SolveKind::kRefine) {
    RIGCAL_RETURN_IF_ERROR(solved.status());
    RIGCAL_RETURN_IF_ERROR(Refine(rig, options, *input.parent, counts, *refused, &*solved));
    *refused = std::move(solved->refused);
    if (hooks.solved) hooks.solved(rig, solved->evaluated.solution);
    return Finish(rig, options, input.parent, &*solved);
  } else {
    odd = SpoilingCamera(solved, rig, clocks, solve);
  }
  if (odd.kind != FindingKind::kUnspecified) {
    absl::StatusOr<Solved> rest = absl::UnknownError("not solved");
    if (!IsNeeded(odd.camera, options)) {
      rest = SolveWithout(odd, &rig, clocks, options, hooks, counts, *refused);
    }
    if (absl::IsCancelled(rest.status())) return rest.status();
    if (rest.ok()) {
      solved = std::move(rest);
    } else if (!solved.ok()) {
      return absl::FailedPreconditionError(
          absl::StrCat("camera ", odd.camera, ": ", odd.advice, ". (",
                       std::string(solved.status().message()), ")"));
    }
  }
  RIGCAL_RETURN_IF_ERROR(solved.status());
  // Where a camera spoils the others, nothing is said about clocks and lenses.
  if (odd.kind == FindingKind::kUnspecified) {
    std::vector<Finding> chosen;
    RIGCAL_RETURN_IF_ERROR(
        FollowClocks(clocks, options, hooks, counts, *refused, held, &rig, &*solved, &chosen));
    RIGCAL_RETURN_IF_ERROR(
        ChooseLenses(clocks, options, hooks, counts, *refused, &rig, &*solved, &chosen));
    AddFindings(std::move(chosen), &*solved);
  }
  *refused = std::move(solved->refused);
  if (hooks.solved) hooks.solved(rig, solved->evaluated.solution);
  return Finish(rig, options, input.parent, &*solved);
}

}  // namespace

CalibrationOutcome Calibrate(CalibrationInput input, const CalibrationOptions& options,
                             const CalibrationHooks& hooks) {
  RefusalCounter refused;
  for (const Refusal& refusal : input.refused) refused.Add(refusal);
  CalibrationOutcome outcome{absl::UnknownError("not run"), {}};
  try {
    outcome.result = Run(input, options, hooks, &refused);
  } catch (const std::bad_alloc&) {
    outcome.result = absl::ResourceExhaustedError("calibration: the memory ran out");
  } catch (const std::exception& error) {
    outcome.result = absl::InternalError(absl::StrCat("calibration: ", error.what()));
  }
  outcome.refused = refused.List();
  if (outcome.result.ok()) outcome.result->refused = outcome.refused;
  return outcome;
}

}  // namespace rigcal::server
