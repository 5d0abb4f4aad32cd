// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "common/status/status_macros.h"
#include "server/solve/diagnose/camera_change.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/diagnose/move_scan.h"
#include "server/solve/diagnose/session_timeline.h"

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
constexpr int kMostParts = 2;          // of one camera, that are looked at again
// By which an explanation with fewer parameters may fit worse.
constexpr double kFewerParametersWorth = 0.03;

struct Candidate {
  size_t camera = 0;                // of the trial
  std::optional<ChangePoint> move;  // that other times confirm
  std::optional<CameraChange> zoom, drift;

  double Gain() const {
    return std::max({move ? move->gain : 0, zoom ? zoom->gain : 0, drift ? drift->gain : 0});
  }
};

// The cameras whose residuals gain by a change that other times confirm, those that gain most
// first.
std::vector<Candidate> BestCandidates(const CauseInput& input, const SessionTimeline& timeline) {
  std::vector<Candidate> all;
  for (size_t c = 0; c < input.trial.problem.cameras.size(); ++c) {
    if (std::ranges::count(input.trial.rig_camera, input.trial.rig_camera[c]) > kMostParts) {
      continue;
    }
    const auto camera = static_cast<int>(c);
    Candidate candidate;
    candidate.camera = c;
    candidate.move = ScanForMove(input.trial, timeline, camera);
    if (candidate.move && (candidate.move->gain < kMinScanGain ||
                           !HoldsForOtherTimes(input.trial, timeline, camera, *candidate.move))) {
      candidate.move.reset();
    }
    if (candidate.move) candidate.zoom = FitZoom(input.trial, timeline, camera, *candidate.move);
    candidate.drift = FitDrift(input.trial, timeline, camera);
    if (candidate.Gain() > 0) all.push_back(std::move(candidate));
  }
  std::ranges::stable_sort(all, std::greater(), &Candidate::Gain);
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
TrialProblem TakenApart(const TrialProblem& from, const SessionTimeline& timeline, size_t camera,
                        const ChangePoint& move) {
  TrialProblem trial = from;
  BundleProblem& problem = trial.problem;
  BundleCamera after = problem.cameras[camera];
  BundleCamera& before = problem.cameras[camera];
  after.cam_from_rig = Moved(after.cam_from_rig, move.after);
  if (before.pose_fixed) {
    // The rig frame is the camera as it was before.
    const RigidTransform fixed = before.cam_from_rig;
    after.cam_from_rig = after.cam_from_rig * Moved(fixed, move.before).Inverse() * fixed;
  } else {
    before.cam_from_rig = Moved(before.cam_from_rig, move.before);
  }
  after.pose_fixed = false;
  after.intrinsics_fixed = true;  // the lens is that of the other part
  const auto part = static_cast<int>(problem.cameras.size());
  problem.cameras.push_back(after);
  trial.rig_camera.push_back(from.rig_camera[camera]);
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    if (!move.HasMoved(timeline.TimeNs(i))) continue;
    const BundleInstant& instant = problem.instants[i];
    for (BundleObservation& observation : problem.ObservationsOf(instant)) {
      if (observation.camera == static_cast<int>(camera)) observation.camera = part;
    }
  }
  // What was an outlier to one pose may fit two.
  ForEachMarker(problem, [&](size_t, const BundleObservation& observation, size_t m) {
    const auto own = static_cast<size_t>(observation.camera);
    if (trial.rig_camera[own] == trial.rig_camera[camera]) problem.markers[m].used = true;
  });
  return trial;
}

// Solves a camera taken apart: two poses of one lens. Where it is refined, in turns with the poses,
// by the part before the move.
absl::Status SolveParts(const BundleOptions& how, size_t camera, BundleProblem* problem) {
  const bool refined = !problem->cameras[camera].intrinsics_fixed;
  problem->cameras[camera].intrinsics_fixed = true;
  // The target's poses are still between those that the two parts would have.
  RIGCAL_RETURN_IF_ERROR(SolveTrialFromAfar(how, problem));
  if (!refined) return absl::OkStatus();
  for (int round = 0; round < kLensRounds; ++round) {
    problem->cameras[camera].intrinsics_fixed = false;
    RIGCAL_RETURN_IF_ERROR(SolveTrial(how, problem));
    problem->cameras.back().intrinsics = problem->cameras[camera].intrinsics;
    problem->cameras[camera].intrinsics_fixed = true;
    RIGCAL_RETURN_IF_ERROR(SolveTrial(how, problem));
  }
  problem->cameras[camera].intrinsics_fixed = false;
  return absl::OkStatus();
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

// One way to explain what a camera sees, tried.
struct Explanation {
  int parameters = 0;
  ErrorChange change;  // of the camera
  TrialProblem repaired;
  Finding finding;
  std::string name;  // such as "with a pose of its own"
};

std::string InParentheses(const Explanation& next) {
  return absl::StrFormat(" (%.2f px %s)", next.change.after_px, next.name);
}

std::string HowLong(const ChangePoint& move) {
  if (!move.IsBack()) return "";
  return absl::StrFormat(", and back %.1f s later,",
                         1e-9 * static_cast<double>(move.until_ns - move.time_ns));
}

std::string DistanceText(const CauseInput& input, double distance_m) {
  const bool metric =
      !input.trial.problem.distance || input.evaluated.options.known_distance.has_value();
  return metric ? absl::StrFormat("%.1f mm and ", 1e3 * distance_m) : std::string();
}

std::optional<Explanation> TryMove(const CauseInput& input, const SessionTimeline& timeline,
                                   size_t camera, const ChangePoint& point) {
  Explanation moved;
  moved.parameters = 6;
  moved.repaired = TakenApart(input.trial, timeline, camera, point);
  if (!SolveParts(input.trial.bundle, camera, &moved.repaired.problem).ok()) return std::nullopt;
  moved.change = CompareErrors(input.trial.problem, moved.repaired.problem)[camera];
  const Move move = MeasureMove(moved.repaired, camera);
  if (moved.change.gain() < kMinMoveGain || move.sigmas < kMoveSigmas ||
      move.image_px < kMinMovePx) {
    return std::nullopt;
  }
  // A pose that little data hold runs away from where the camera is: an image that really moved so
  // far would not fit so well with one pose.
  if (move.image_px >
      kMaxMovePerError * LargestErrorPx(input.trial, timeline, static_cast<int>(camera), point)) {
    return std::nullopt;
  }
  moved.name = "if it moved at once";
  moved.finding = {
      FindingKind::kCameraMoved, input.trial.problem.cameras[camera].name, move.image_px, "px",
      absl::StrFormat(
          "it moved %s%s by %s%.3f deg, which moved its image by %.1f px; its error is %.2f px, "
          "and %.2f px "
          "with a pose of its own from then on%s$NEXT. Fix its mount and record again, or "
          "calibrate what was recorded after it moved",
          timeline.Describe(point.time_ns), HowLong(point), DistanceText(input, move.centre_m),
          kDegreesPerRadian * move.rotation_rad, move.image_px, moved.change.before_px,
          moved.change.after_px, point.IsBack() ? " until it was back" : "")};
  return moved;
}

std::string ZoomText(const SessionTimeline& timeline, const CameraChange& change, double image_px,
                     const ErrorChange& errors) {
  return absl::StrFormat(
      "zoom or focus was turned %s%s and its image is %.2f %% %s since, which moved it by %.1f px; "
      "its "
      "error is %.2f px, and %.2f px with that taken out$NEXT. Lock zoom and focus and record "
      "again, or calibrate what was recorded after",
      timeline.Describe(change.when.time_ns), HowLong(change.when), 100 * std::abs(change.zoom),
      change.zoom > 0 ? "larger" : "smaller", image_px, errors.before_px, errors.after_px);
}

std::string DriftText(const CauseInput& input, const CameraChange& change, double image_px,
                      const ErrorChange& errors) {
  return absl::StrFormat(
      "it moves slowly, by %s%.3f deg from the first wand view to the last, which moved its image "
      "by %.1f px; its error is %.2f px, and %.2f px with that taken out$NEXT. Tighten its mount, "
      "or let it warm up, and record again",
      DistanceText(input, change.drift.tail<3>().norm()),
      kDegreesPerRadian * change.drift.head<3>().norm(), image_px, errors.before_px,
      errors.after_px);
}

std::optional<Explanation> TryChange(const CauseInput& input, const SessionTimeline& timeline,
                                     size_t camera, CameraChange change) {
  const auto index = static_cast<int>(camera);
  auto solved = SolveWithout(input.trial, timeline, index, &change);
  if (!solved.ok()) return std::nullopt;
  Explanation changed;
  changed.parameters = change.parameters;
  changed.repaired = *std::move(solved);
  changed.change = CompareErrors(input.trial.problem, changed.repaired.problem)[camera];
  const double image_px = ImageMotionPx(changed.repaired, timeline, index, change);
  if (changed.change.gain() < kMinMoveGain || image_px < kMinMovePx) return std::nullopt;
  const bool is_zoom = change.form == CameraChange::Form::kZoom;
  changed.name = is_zoom ? "if zoom or focus was turned" : "if it moved slowly";
  changed.finding = {is_zoom ? FindingKind::kLensChanged : FindingKind::kCameraMoved,
                     input.trial.problem.cameras[camera].name, image_px, "px",
                     is_zoom ? ZoomText(timeline, change, image_px, changed.change)
                             : DriftText(input, change, image_px, changed.change)};
  return changed;
}

// What explains most, or nearly as much with fewer parameters, first.
bool ExplainsBetter(const Explanation& a, const Explanation& b) {
  const auto worth = [](const Explanation& own, const Explanation& other) {
    return own.parameters > other.parameters ? 1 + kFewerParametersWorth : 1.0;
  };
  return a.change.after_px * worth(a, b) < b.change.after_px * worth(b, a);
}

Repair Explain(const CauseInput& input, const Candidate& candidate) {
  const SessionTimeline timeline(input.trial, input.evaluated.solution.clocks);
  std::vector<Explanation> tried;
  const auto add = [&tried](std::optional<Explanation> explanation) {
    if (explanation) tried.push_back(*std::move(explanation));
  };
  if (candidate.move) add(TryMove(input, timeline, candidate.camera, *candidate.move));
  for (const std::optional<CameraChange>& change : {candidate.zoom, candidate.drift}) {
    if (change) add(TryChange(input, timeline, candidate.camera, *change));
  }
  Repair repair;
  if (tried.empty()) return repair;
  const auto best = std::ranges::min_element(tried, ExplainsBetter);
  std::iter_swap(tried.begin(), best);
  std::string next;
  if (tried.size() > 1) {
    next = InParentheses(*std::min_element(tried.begin() + 1, tried.end(), ExplainsBetter));
  }
  Explanation& first = tried.front();
  first.finding.advice = absl::StrReplaceAll(first.finding.advice, {{"$NEXT", next}});
  repair.causes.push_back({std::move(first.finding), first.change.gain_px()});
  repair.repaired = std::move(first.repaired);
  // A part of a camera taken apart is in no other trial.
  const std::vector<size_t>& rig_camera = input.trial.rig_camera;
  if (std::ranges::count(rig_camera, rig_camera[candidate.camera]) == 1) {
    repair.on_other = [candidate](const CauseInput& other) { return Explain(other, candidate); };
  }
  return repair;
}

}  // namespace

Repair RepairMovedCamera(const CauseInput& input) {
  const SessionTimeline timeline(input.trial, input.evaluated.solution.clocks);
  for (const Candidate& candidate : BestCandidates(input, timeline)) {
    Repair repair = Explain(input, candidate);
    if (!repair.causes.empty()) return repair;
  }
  return {};
}

}  // namespace rigcal::server
