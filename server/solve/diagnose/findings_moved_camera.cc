// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/diagnose/move_scan.h"
#include "server/solve/diagnose/session_timeline.h"
#include "server/solve/rig/outliers.h"

namespace rigcal::server {
namespace {

constexpr double kMinMoveGain = 0.08;
constexpr double kMinMovePx = 0.3;
// Of six numbers together; by chance below once in ten million.
constexpr double kMoveSigmas = 7;
constexpr double kDegreesPerRadian = 57.29577951308232;
constexpr int kLensRounds = 2;
constexpr double kMaxMovePerError = 10;
constexpr size_t kMostTakenApart = 3;  // cameras that are tried, one after the other

struct Candidate {
  size_t camera = 0;  // of the trial
  ChangePoint change;
};

// The cameras whose residuals gain by a move that other times confirm, those that gain most first.
std::vector<Candidate> BestCandidates(const CauseInput& input, const SessionTimeline& timeline) {
  std::vector<Candidate> all;
  for (size_t c = 0; c < input.trial.problem.cameras.size(); ++c) {
    // One that was taken apart already is not looked at again.
    if (std::ranges::count(input.trial.rig_camera, input.trial.rig_camera[c]) > 1) continue;
    const std::optional<ChangePoint> change =
        ScanForMove(input.trial, timeline, static_cast<int>(c));
    if (!change || change->gain < kMinScanGain) continue;
    if (!HoldsForOtherTimes(input.trial, timeline, static_cast<int>(c), *change)) continue;
    all.push_back({c, *change});
  }
  std::ranges::stable_sort(all, std::greater(), [](const Candidate& it) { return it.change.gain; });
  all.resize(std::min(all.size(), kMostTakenApart));
  return all;
}

RigidTransform Moved(const RigidTransform& pose, const PoseStep& step) {
  const Eigen::Vector3d turn = step.head<3>();
  const double angle = turn.norm();
  RigidTransform moved = pose;
  if (angle > 0) {
    moved.rotation = (Eigen::AngleAxisd(angle, turn / angle) * pose.rotation).normalized();
  }
  moved.translation_m += step.tail<3>();
  return moved;
}

// The camera's observations from the change on belong to a camera of their own.
TrialProblem TakenApart(const TrialProblem& from, const SessionTimeline& timeline,
                        const Candidate& candidate) {
  TrialProblem trial = from;
  BundleProblem& problem = trial.problem;
  BundleCamera after = problem.cameras[candidate.camera];
  BundleCamera& before = problem.cameras[candidate.camera];
  after.cam_from_rig = Moved(after.cam_from_rig, candidate.change.after);
  if (before.pose_fixed) {
    // The rig frame is the camera as it was before.
    const RigidTransform fixed = before.cam_from_rig;
    after.cam_from_rig =
        after.cam_from_rig * Moved(fixed, candidate.change.before).Inverse() * fixed;
  } else {
    before.cam_from_rig = Moved(before.cam_from_rig, candidate.change.before);
  }
  after.pose_fixed = false;
  after.intrinsics_fixed = true;  // the lens is that of the other part
  const auto part = static_cast<int>(problem.cameras.size());
  problem.cameras.push_back(after);
  trial.rig_camera.push_back(from.rig_camera[candidate.camera]);
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    if (!candidate.change.HasMoved(timeline.TimeNs(i))) continue;
    const BundleInstant& instant = problem.instants[i];
    for (BundleObservation& observation : problem.ObservationsOf(instant)) {
      if (observation.camera == static_cast<int>(candidate.camera)) observation.camera = part;
    }
  }
  ClassifyOutliers(&problem);
  return trial;
}

// Solves a camera taken apart: two poses of one lens. Where it is refined, in turns with the poses,
// by the part before the move.
absl::Status SolveParts(const BundleOptions& how, size_t camera, BundleProblem* problem) {
  const bool refined = !problem->cameras[camera].intrinsics_fixed;
  for (int round = 0; round < (refined ? kLensRounds : 1); ++round) {
    problem->cameras[camera].intrinsics_fixed = true;
    RIGCAL_RETURN_IF_ERROR(SolveTrial(how, problem));
    if (!refined) break;
    problem->cameras[camera].intrinsics_fixed = false;
    RIGCAL_RETURN_IF_ERROR(SolveTrial(how, problem));
    problem->cameras.back().intrinsics = problem->cameras[camera].intrinsics;
  }
  return SolveTrial(how, problem);
}

struct Move {
  double rotation_rad = 0;
  double centre_m = 0;
  double image_px = 0;  // root mean square of how far the image moved, where the wand was
  double sigmas = 0;
};

Move MeasureMove(const TrialProblem& trial, size_t camera) {
  const BundleProblem& problem = trial.problem;
  const BundleCamera& before = problem.cameras[camera];
  const BundleCamera& after = problem.cameras.back();
  Move move;
  move.rotation_rad = before.cam_from_rig.rotation.angularDistance(after.cam_from_rig.rotation);
  move.centre_m = (before.cam_from_rig.SourceFromTargetTranslation() -
                   after.cam_from_rig.SourceFromTargetTranslation())
                      .norm();
  BundleProblem as_before = problem;
  as_before.cameras.back().cam_from_rig = before.cam_from_rig;
  const ErrorChange change = CompareErrors(problem, as_before).back();
  move.image_px = std::max(0.0, -change.gain_px());
  // Both parts with the freedom of the one lens.
  BundleProblem shared = problem;
  BundleCamera& copy = shared.cameras.back();
  copy.intrinsics_fixed = before.intrinsics_fixed;
  copy.intrinsics_mean = before.intrinsics_mean;
  copy.intrinsics_sigma = before.intrinsics_sigma;
  const std::pair<int, int> parts = {static_cast<int>(camera),
                                     static_cast<int>(problem.cameras.size()) - 1};
  if (const auto sigmas = ComputeSigmas(trial.bundle, shared, parts); sigmas.ok()) {
    const Eigen::AngleAxisd turn(after.cam_from_rig.rotation *
                                 before.cam_from_rig.rotation.conjugate());
    PoseStep difference;
    difference << turn.angle() * turn.axis(),
        after.cam_from_rig.translation_m - before.cam_from_rig.translation_m;
    move.sigmas = sigmas->PoseDistance(parts.first, parts.second, difference);
  }
  return move;
}

Repair TakeApart(const CauseInput& input, const Candidate& candidate) {
  const SessionTimeline timeline(input.trial, input.evaluated.solution.clocks);
  Repair repair;
  repair.repaired = TakenApart(input.trial, timeline, candidate);
  if (!SolveParts(input.trial.bundle, candidate.camera, &repair.repaired.problem).ok()) {
    return repair;
  }
  const auto camera = static_cast<int>(candidate.camera);
  const ErrorChange change =
      CompareErrors(input.trial.problem, repair.repaired.problem)[candidate.camera];
  const Move move = MeasureMove(repair.repaired, candidate.camera);
  if (change.gain() < kMinMoveGain || move.sigmas < kMoveSigmas || move.image_px < kMinMovePx) {
    return repair;
  }
  // A pose that little data hold runs away from where the camera is: an image that really moved so
  // far would not fit so well with one pose.
  if (move.image_px >
      kMaxMovePerError * LargestErrorPx(input.trial, timeline, camera, candidate.change)) {
    return repair;
  }
  const bool metric =
      !input.trial.problem.distance || input.evaluated.options.known_distance.has_value();
  const std::string distance =
      metric ? absl::StrFormat("%.1f mm and ", 1e3 * move.centre_m) : std::string();
  const std::string back =
      candidate.change.IsBack()
          ? absl::StrFormat(
                ", and back %.1f s later,",
                1e-9 * static_cast<double>(candidate.change.until_ns - candidate.change.time_ns))
          : std::string();
  const double angle_deg = kDegreesPerRadian * move.rotation_rad;
  repair.causes.push_back(
      {{FindingKind::kCameraMoved, input.trial.problem.cameras[candidate.camera].name,
        move.image_px, "px",
        absl::StrFormat(
            "%s%s by %s%.3f deg, which moved its "
            "image by %.1f px; its error is %.2f px, and %.2f px with a pose of its own from then "
            "on%s. Fix its mount and record again, or calibrate what was recorded after it moved",
            timeline.Describe(candidate.change.time_ns), back, distance, angle_deg, move.image_px,
            change.before_px, change.after_px, back.empty() ? "" : " until it was back")},
       change.gain_px()});
  repair.on_other = [candidate](const CauseInput& other) { return TakeApart(other, candidate); };
  return repair;
}

}  // namespace

Repair RepairMovedCamera(const CauseInput& input) {
  const SessionTimeline timeline(input.trial, input.evaluated.solution.clocks);
  for (const Candidate& candidate : BestCandidates(input, timeline)) {
    Repair repair = TakeApart(input, candidate);
    if (!repair.causes.empty()) return repair;
  }
  return {};
}

}  // namespace rigcal::server
