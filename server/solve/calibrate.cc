// SPDX-License-Identifier: Apache-2.0
#include "server/solve/calibrate.h"

#include <algorithm>
#include <exception>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/status/status_macros.h"
#include "common/target/target_words.h"
#include "server/associate/far_clocks.h"
#include "server/associate/repeated_rows.h"
#include "server/associate/stamp_units.h"
#include "server/associate/static_points.h"
#include "server/associate/straight_clocks.h"
#include "server/associate/unseen_markers.h"
#include "server/solve/bad_rows.h"
#include "server/solve/calibration_report.h"
#include "server/solve/clocks/motion_evidence.h"
#include "server/solve/connected_part.h"
#include "server/solve/derivation.h"
#include "server/solve/evaluate/parameter_information.h"
#include "server/solve/evaluate/pose_covariance.h"
#include "server/solve/evaluate/pose_prior.h"
#include "server/solve/evaluate/quality_gate.h"
#include "server/solve/evaluate/restart.h"
#include "server/solve/followed_clocks.h"
#include "server/solve/frame_derivation.h"
#include "server/solve/headline.h"
#include "server/solve/initialize/overlap_graph.h"
#include "server/solve/input_checks.h"
#include "server/solve/kept_frame.h"
#include "server/solve/lamp_readings.h"
#include "server/solve/misfit_causes.h"
#include "server/solve/solve_and_report.h"
#include "server/solve/spoiling_camera.h"
#include "server/solve/unsound_rows.h"
#include "server/solve/unused_views.h"

namespace rigcal::server {
namespace {

constexpr int kMaxLensRounds = 3;

// With the lenses that the data prefer, where the intrinsics are for the solve to choose: in
// rounds, because one lens that is described wrongly spoils the errors of the others. What cannot
// be solved with them stays as it was. CANCELLED.
absl::Status ChooseLenses(const std::vector<ClockCorrection>& clocks,
                          const CalibrationOptions& options, const CalibrationHooks& hooks,
                          const std::map<std::string, CameraCounts>& counts,
                          const RefusalCounter& refused, const std::shared_ptr<const HeldRig>& held,
                          RigObservations* rig, Solved* solved, std::vector<Finding>* chosen) {
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
    RigSolveOptions solve = SolveOptionsOf(changed, options, hooks, counts, held);
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

// What was chosen may cap the grade: a lens that only these data describe is at most usable. What
// makes the result bad comes first.
void AddFindings(std::vector<Finding> findings, Solved* solved) {
  if (findings.empty()) return;
  CalibrationResult& result = solved->result;
  for (Finding& finding : findings) {
    finding.severity = SeverityOf(result, finding);
    const bool is_error = finding.severity == FindingSeverity::kError;
    result.findings.insert(is_error ? result.findings.begin() : result.findings.end(),
                           std::move(finding));
  }
  result.quality = GradeQuality(result, solved->evaluated.predicted);
}

void CallHooks(const CalibrationHooks& hooks, const RigObservations& rig,
               const EvaluatedSolution& evaluated) {
  if (hooks.solved) hooks.solved(rig, evaluated.solution);
  if (hooks.evaluated) hooks.evaluated(rig, evaluated);
}

// What is known only once everything that was left out is.
void NoteUnused(const RigObservations& rig, const std::map<std::string, CameraCounts>& counts,
                const RefusalCounter& refused, Solved* solved) {
  NoteUnusedViews(counts, refused.List(), &solved->result);
  solved->result.quality = GradeQuality(solved->result, solved->evaluated.predicted);
  solved->result.headline =
      MakeHeadline(rig, solved->evaluated, counts, refused.List(), solved->result);
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
  // What decides the grade first; the cause of most of the error first of these.
  std::ranges::stable_sort(result.findings, std::greater(), &Finding::severity);
  return result;
}

// The cameras that are connected, without the others; where that succeeds, what follows is of them
// alone.
absl::StatusOr<Solved> SolvePart(const ConnectedPart& part, const CalibrationHooks& hooks,
                                 const std::map<std::string, CameraCounts>& counts,
                                 RefusalCounter* refused, CalibrationOptions* options,
                                 std::vector<ClockCorrection>* clocks, RigObservations* rig) {
  std::vector<ClockCorrection> remaining = *clocks;
  RigObservations rest = WithoutCameras(*rig, part.left_out, &remaining);
  CalibrationOptions own = *options;
  own.reference_camera = part.reference_camera;
  RefusalCounter with_left_out = *refused;
  for (const std::string& camera : part.left_out) {
    with_left_out.Add(camera, RefusalReason::kOutlier, counts.at(camera).wand_count,
                      "the whole camera was left out (see findings)");
  }
  absl::StatusOr<Solved> solved = SolveAndReport(
      rest, remaining, SolveOptionsOf(rest, own, hooks, counts), own, counts, with_left_out);
  if (!solved.ok()) return solved;
  *refused = std::move(with_left_out);
  *options = std::move(own);
  *clocks = std::move(remaining);
  *rig = std::move(rest);
  return solved;
}

absl::StatusOr<CalibrationResult> Run(CalibrationInput& input, const CalibrationOptions& asked,
                                      const CalibrationHooks& hooks, RefusalCounter* refused) {
  RIGCAL_RETURN_IF_ERROR(asked.Validate());
  if (ChangesFrameOnly(asked.kind)) return DeriveFrame(&input, asked, refused);
  RIGCAL_RETURN_IF_ERROR(ApplyDerivation(asked, &input));
  CalibrationOptions options = WithDefaults(asked, input);
  RIGCAL_RETURN_IF_ERROR(ValidateInput(input, options));
  const auto progress = [&hooks](CalibrationStage stage, double fraction) {
    if (hooks.progress) hooks.progress(stage, fraction);
  };
  progress(CalibrationStage::kAssociating, 0);
  std::vector<Finding> of_stamps = FindingsOf(HideMarkersAtOrigin(&input.tracks));
  const std::map<std::string, CameraCounts> counts = CountInput(input);
  RIGCAL_RETURN_IF_ERROR(CheckReadRows(counts, input.refused));
  RIGCAL_RETURN_IF_ERROR(CheckCameras(counts, options));
  RIGCAL_RETURN_IF_ERROR(CheckMarkersTogether(input));
  RIGCAL_RETURN_IF_ERROR(CheckImageSizes(input.tracks));
  RIGCAL_RETURN_IF_ERROR(CheckColumns(input.tracks));
  std::ranges::copy(FindingsOf(UseRepeatedRowsOnce(&input.tracks, refused)),
                    std::back_inserter(of_stamps));
  RigObservations rig;
  rig.target = input.target;
  rig.other_targets = input.other_targets;
  const auto target_of = [&rig](const std::string& session_id) -> const Target& {
    return rig.TargetOf(session_id);
  };
  RIGCAL_ASSIGN_OR_RETURN(const UnsoundRows unsound,
                          TakeUnsoundRows(options, target_of, &input, refused));
  std::ranges::copy(unsound.findings, std::back_inserter(of_stamps));
  const std::string far_clocks = DescribeFarClocks(input.tracks);
  MotionEvidence evidence(input.tracks, target_of);
  std::ranges::copy(FindingsOf(StraightenClocks(&input.tracks, refused, std::ref(evidence))),
                    std::back_inserter(of_stamps));
  RIGCAL_RETURN_IF_ERROR(CheckStampUnits(input.tracks));
  std::vector<StampFault> of_lights;
  rig.tracks = AlignTracks(&input.tracks, target_of, refused, &of_lights);
  std::ranges::copy(FindingsOf(of_lights), std::back_inserter(of_stamps));
  std::vector<ClockCorrection> clocks;
  rig.index = IndexRig(rig.tracks, &clocks);
  RIGCAL_RETURN_IF_ERROR(CheckTracks(rig.index, counts, unsound.left_out));
  RIGCAL_RETURN_IF_ERROR(CheckMotion(rig, counts));

  RigSolveOptions solve = SolveOptionsOf(rig, options, hooks, counts);
  absl::StatusOr<Solved> solved = SolveAndReport(rig, clocks, solve, options, counts, *refused);
  if (absl::IsFailedPrecondition(solved.status()) &&
      (!unsound.findings.empty() || !far_clocks.empty())) {
    return absl::FailedPreconditionError(absl::StrCat(
        unsound.findings.empty() ? far_clocks
                                 : absl::StrCat("camera ", unsound.findings.front().camera, ": ",
                                                unsound.findings.front().advice),
        ". (", std::string(solved.status().message()), ")"));
  }
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
    AddFindings(of_stamps, &*solved);
    AddFindings(FindLampContradictions(LampPhasesOf(input.tracks, rig, solved->evaluated)),
                &*solved);
    NoteUnused(rig, counts, *refused, &*solved);
    CallHooks(hooks, rig, solved->evaluated);
    return Finish(rig, options, input.parent, &*solved);
  } else {
    odd = SpoilingCamera(solved, rig, clocks, solve);
    // It agrees with nobody because it has nothing to agree on: the error says for whom to wave.
    if (!solved.ok() && odd.kind == FindingKind::kInconsistentCamera &&
        SeesTheWandAlone(rig, odd.camera)) {
      odd = {};
    }
  }
  const std::string spans = SpanContradiction(rig);
  if (odd.kind == FindingKind::kInconsistentCamera && !spans.empty()) {
    odd.advice = absl::StrCat(spans, "; ", odd.advice);
  }
  if (odd.kind == FindingKind::kInconsistentCamera) {
    const std::string stretched = StretchedStamps(rig, odd.camera);
    if (!stretched.empty()) odd.advice = absl::StrCat(stretched, " ", odd.advice);
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
  if (absl::IsFailedPrecondition(solved.status()) && !spans.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat(spans, ". (", std::string(solved.status().message()), ")"));
  }
  std::optional<ConnectedPart> part;
  if (!solved.ok() && options.kind == SolveKind::kFull) {
    part = FindConnectedPart(solved.status(), rig.index, options, !asked.reference_camera.empty());
  }
  if (part) {
    absl::StatusOr<Solved> of_part =
        SolvePart(*part, hooks, counts, refused, &options, &clocks, &rig);
    if (absl::IsCancelled(of_part.status())) return of_part.status();
    if (of_part.ok()) {
      solved = std::move(of_part);
    } else {
      part.reset();
    }
  }
  if (!solved.ok()) return WithoutGroups(solved.status());
  // Where a camera spoils the others, nothing is said about clocks and lenses.
  if (odd.kind == FindingKind::kUnspecified) {
    std::vector<Finding> chosen;
    LeftOutRows left_out;
    RIGCAL_RETURN_IF_ERROR(
        LeaveOutBadRows(clocks, options, hooks, counts, held, refused, &rig, &*solved, &left_out));
    chosen = left_out.findings;
    RIGCAL_RETURN_IF_ERROR(
        FollowClocks(clocks, options, hooks, counts, *refused, held, &rig, &*solved, &chosen));
    RIGCAL_RETURN_IF_ERROR(
        ChooseLenses(clocks, options, hooks, counts, *refused, held, &rig, &*solved, &chosen));
    CountAsOutliers(left_out, &solved->result);
    AddFindings(std::move(chosen), &*solved);
  }
  if (part) AddFindings(std::move(part->findings), &*solved);
  AddFindings(of_stamps, &*solved);
  AddFindings(FindLampContradictions(LampPhasesOf(input.tracks, rig, solved->evaluated)), &*solved);
  *refused = std::move(solved->refused);
  NoteUnused(rig, counts, *refused, &*solved);
  CallHooks(hooks, rig, solved->evaluated);
  return Finish(rig, options, input.parent, &*solved);
}

// What people read of it, about the target that they waved.
void SpeakOfTarget(const Target& target, absl::StatusOr<CalibrationResult>* result) {
  if (!result->ok()) {
    const absl::Status& status = result->status();
    absl::Status spoken(status.code(), SpeakOf(target, std::string(status.message())));
    status.ForEachPayload(
        [&](absl::string_view url, const absl::Cord& payload) { spoken.SetPayload(url, payload); });
    *result = std::move(spoken);
    return;
  }
  for (Finding& finding : (*result)->findings) {
    finding.advice = SpeakOf(target, std::move(finding.advice));
  }
  for (std::string& reason : (*result)->quality.reasons)
    reason = SpeakOf(target, std::move(reason));
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
  if (input.other_targets.empty()) {
    SpeakOfTarget(input.target, &outcome.result);
    for (Refusal& refusal : outcome.refused) {
      refusal.example = SpeakOf(input.target, std::move(refusal.example));
    }
  }
  if (outcome.result.ok()) outcome.result->refused = outcome.refused;
  return outcome;
}

}  // namespace rigcal::server
