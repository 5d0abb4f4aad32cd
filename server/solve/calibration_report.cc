// SPDX-License-Identifier: Apache-2.0
#include "server/solve/calibration_report.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/camera/intrinsics_vector.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/clock_report.h"
#include "server/solve/diagnose/findings.h"
#include "server/solve/evaluate/error_figures.h"
#include "server/solve/evaluate/quality_gate.h"
#include "server/solve/evaluate/residual_vectors.h"
#include "server/solve/observation_digest.h"
#include "server/solve/rig/trajectory_fit.h"

namespace rigcal::server {
namespace {

constexpr int kMinObservations = 5;
constexpr double kLowShare = 0.01, kHighShare = 0.99;  // of the coordinates of the wand's ends

// The first track of a camera; tracks are sorted by session.
size_t FirstTrack(const RigIndex& index, size_t camera) {
  const auto found = std::ranges::find(index.camera_of_track, static_cast<int>(camera));
  return static_cast<size_t>(found - index.camera_of_track.begin());
}

// By track, the rows that a path has and no instant; those that it has are marked in `used`.
std::vector<uint32_t> RowsOfPathAlone(const ReportInput& input,
                                      std::vector<std::vector<bool>>* used) {
  std::vector<uint32_t> counts(used->size(), 0);
  const RigSolution& solution = input.evaluated.solution;
  if (solution.trajectory == nullptr) return counts;
  const TrajectoryFit& fit = *solution.trajectory;
  ForEachUsedMarkerOfRows(
      fit.problem, [&](size_t, const BundleObservation&, const BundleMarker& marker) {
        const MarkerSource& source = fit.sources[fit.problem.rows.IndexOf(marker)];
        const auto t = static_cast<size_t>(source.track);
        auto&& is_used = (*used)[t][static_cast<size_t>(source.observation)];
        counts[t] += is_used ? 0 : 1;
        is_used = true;
      });
  return counts;
}

// By track and row: it is a member of an instant; only of those that are used, or of any.
std::vector<std::vector<bool>> RowsOfInstants(const ReportInput& input, bool any) {
  std::vector<std::vector<bool>> used;
  for (const AlignedTrack& track : input.rig.tracks) {
    used.emplace_back(track.track.observations.size(), false);
  }
  const std::vector<Instant>& instants = input.evaluated.solution.instants.instants;
  for (size_t i = 0; i < instants.size(); ++i) {
    if (!any && !input.evaluated.solution.built.problem.instants[i].used) continue;
    for (const InstantMember& member : instants[i].members) {
      used[static_cast<size_t>(member.track)][static_cast<size_t>(member.observation)] = true;
    }
  }
  return used;
}

void CountWhatWasLeftOut(const ReportInput& input, RefusalCounter* refused) {
  const RigSolution& solution = input.evaluated.solution;
  const BundleProblem& problem = solution.built.problem;
  std::vector<std::vector<bool>> used = RowsOfInstants(input, true);
  const std::vector<uint32_t> by_path = RowsOfPathAlone(input, &used);
  for (size_t t = 0; t < input.rig.tracks.size(); ++t) {
    const std::string& camera = input.rig.tracks[t].track.camera.camera;
    // Of which of the two they are is all the same.
    const uint32_t alone = std::min(by_path[t], solution.instants.alone_count[t]);
    const uint32_t skipped = std::min(by_path[t] - alone, solution.instants.skipped_count[t]);
    refused->Add(camera, RefusalReason::kAloneInInstant, solution.instants.alone_count[t] - alone,
                 input.rig.tracks[t].is_static ? "no other camera saw that static point"
                                               : "no other camera saw the wand at that time");
    refused->Add(camera, RefusalReason::kNotNearestInInstant,
                 solution.instants.skipped_count[t] - skipped,
                 "it saw the wand again nearer the instant that it shares with other cameras");
  }
  for (const BundleInstant& instant : problem.instants) {
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      const std::string& camera = problem.CameraOf(observation).name;
      if (!instant.used) {
        refused->Add(camera, RefusalReason::kInstantWithoutPose, 1,
                     "too few markers in common to place the wand");
        continue;
      }
      refused->Add(camera, RefusalReason::kLabelsFlipped, IsFlipped(solution, observation) ? 1 : 0,
                   "labels fit the other cameras when counted from the other end");
      const auto outliers =
          std::ranges::count(problem.MarkersOf(observation), false, &BundleMarker::used);
      refused->Add(camera, RefusalReason::kOutlier, static_cast<uint64_t>(outliers),
                   "markers far from where the others put them");
    }
  }
}

std::string Digest(const ReportInput& input) {
  std::vector<std::vector<bool>> used = RowsOfInstants(input, false);
  RowsOfPathAlone(input, &used);
  return ObservationDigest(input.options, input.rig.Parts(), input.rig.tracks, used);
}

CalibratedTrajectory ReportTrajectory(const ReportInput& input) {
  CalibratedTrajectory trajectory;
  trajectory.kind = CalibratedTrajectory::Kind::kInterpolated;
  if (input.evaluated.path_gain && input.evaluated.path_gain->blocks > 0) {
    trajectory.held_out_interpolated_px = input.evaluated.path_gain->before_px;
    trajectory.held_out_spline_px = input.evaluated.path_gain->after_px;
  }
  if (const TrajectoryFit* const fit = input.evaluated.solution.trajectory.get()) {
    trajectory.kind = CalibratedTrajectory::Kind::kSpline;
    trajectory.knot_spacing_s = fit->KnotStepS();
    trajectory.jerk_density = fit->JerkDensity();
    std::vector<std::vector<bool>> used = RowsOfInstants(input, true);
    for (const uint32_t count : RowsOfPathAlone(input, &used)) trajectory.added_row_count += count;
  }
  return trajectory;
}

// Of the rigid target: the part that an instant shows, from its first point to behind its last.
std::pair<int, int> PartOf(const BundleProblem& problem, const BundleInstant& instant) {
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      for (const std::pair<int, int>& part : problem.rigid_target.Parts()) {
        if (marker.marker >= part.first && marker.marker < part.second) return part;
      }
    }
  }
  return {0, 0};
}

// Of the wand that an instant shows.
double LengthOf(const BundleProblem& problem, const BundleInstant& instant) {
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      const auto end = static_cast<size_t>(problem.target.WandOf(marker.marker).end);
      return problem.target.marker_positions_m[end - 1];
    }
  }
  return 0;
}

// The volume of the ends of the placed target; none if none was placed.
std::optional<WandVolume> MeasureWandVolume(const BundleProblem& problem) {
  std::array<std::vector<double>, 3> coordinates;
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    const auto add = [&coordinates](const Eigen::Vector3d& point_m) {
      for (int i = 0; i < 3; ++i) coordinates[static_cast<size_t>(i)].push_back(point_m[i]);
    };
    if (instant.is_rigid) {
      const auto [first, last] = PartOf(problem, instant);
      for (int m = first; m < last; ++m) {
        add(instant.origin_m +
            instant.rotation * problem.rigid_target.points_m[static_cast<size_t>(m)]);
      }
      continue;
    }
    // The ends of the wand; the other markers are between them.
    for (const double s_m : {0.0, LengthOf(problem, instant)}) {
      add(instant.origin_m + s_m * instant.direction);
    }
  }
  if (coordinates[0].empty()) return std::nullopt;
  WandVolume volume;
  for (size_t i = 0; i < 3; ++i) {
    std::vector<double>& values = coordinates[i];
    volume.min_m[static_cast<Eigen::Index>(i)] = LowerQuantile(&values, kLowShare);
    volume.max_m[static_cast<Eigen::Index>(i)] = UpperQuantile(&values, kHighShare);
  }
  return volume;
}

// A rigid target, or a point: without spans. Of a point alone the scale comes from a known
// distance, if any.
CalibratedTarget ReportRigidTarget(const ReportInput& input, const Target& given) {
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  CalibratedTarget target;
  target.given = given;
  target.marker_positions_estimated =
      given.kind == TargetKind::kRigid && !problem.rigid_target.fixed &&
      std::ranges::any_of(given.points, [](const TargetPoint& point) { return point.sigma_m > 0; });
  if (input.evaluated.uncertainty) {
    target.scale_sigma_rel = input.evaluated.uncertainty->scale_sigma_rel;
  }
  return target;
}

template <typename T>
std::vector<T> Slice(const std::vector<T>& values, int first, size_t count) {
  const auto begin = values.begin() + first;
  return {begin, begin + static_cast<std::ptrdiff_t>(count)};
}

CalibratedTarget ReportTarget(const ReportInput& input, const TargetParts::Part& part,
                              const Target& given) {
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  if (given.kind != TargetKind::kWand) return ReportRigidTarget(input, given);
  const size_t count = given.marker_positions_m.size();
  const std::vector<double>& positions_m = problem.target.marker_positions_m;
  CalibratedTarget target;
  target.given = given;
  target.marker_positions_m = Slice(positions_m, part.first_marker, count);
  target.marker_positions_estimated = !problem.target.fixed;
  const LengthErrors lengths =
      Slice(MeasureLengths(problem, positions_m, 2), part.first_marker, count - 1);
  target.spans = SummariseSpans(lengths, target.marker_positions_m);
  target.length_error_rms_m = OverallRms(lengths);
  if (input.evaluated.uncertainty) {
    target.marker_position_sigma_m =
        Slice(input.evaluated.uncertainty->marker_position_sigma_m, part.first_marker, count);
    target.scale_sigma_rel = input.evaluated.uncertainty->scale_sigma_rel;
  }
  if (input.evaluated.held_out) {
    const std::vector<SpanError> held_out =
        SummariseSpans(Slice(input.evaluated.held_out->lengths, part.first_marker, count - 1),
                       target.marker_positions_m);
    for (size_t s = 0; s < target.spans.size(); ++s) {
      target.spans[s].held_out_error_rms_m = held_out[s].error_rms_m;
      target.spans[s].held_out_count = held_out[s].count;
    }
  }
  return target;
}

// Where the points of a session were found.
void AddStaticPoints(const ReportInput& input, const std::string& session,
                     CalibratedTarget* target) {
  const RigSolution& solution = input.evaluated.solution;
  const BundleProblem& problem = solution.built.problem;
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const InstantMember& first = solution.instants.instants[i].members.front();
    const AlignedTrack& track = input.rig.tracks[static_cast<size_t>(first.track)];
    if (track.track.session_id != session) continue;
    std::map<int, CalibratedPoint> points;  // by label
    ForEachUsedMarker(
        problem, problem.instants[i], [&](const BundleObservation&, const BundleMarker& marker) {
          const int part = input.rig.Parts().Of(session).first_marker;
          const int label = track.static_points.empty()
                                ? marker.marker - part
                                : track.static_points[static_cast<size_t>(first.observation)];
          CalibratedPoint& point = points[label];
          point.label = target->given.points[static_cast<size_t>(label)].label;
          point.session_id = session;
          point.position_m = problem.PointOf(problem.instants[i], marker);
          ++point.camera_count;
        });
    for (auto& [label, point] : points) target->static_points.push_back(std::move(point));
  }
}

// One for each that was given, with the sessions it was waved in; of several a wand comes first.
void ReportTargets(const ReportInput& input, CalibrationResult* result) {
  const TargetParts parts = input.rig.Parts();
  std::vector<CalibratedTarget> targets;
  std::string last_session;
  for (const AlignedTrack& track : input.rig.tracks) {
    const std::string& session = track.track.session_id;
    if (!targets.empty() && session == last_session) continue;
    last_session = session;
    const Target& given = input.rig.TargetOf(session);
    auto known = std::ranges::find(targets, given, &CalibratedTarget::given);
    if (known == targets.end()) {
      targets.push_back(ReportTarget(input, parts.Of(session), given));
      known = std::prev(targets.end());
    }
    known->session_ids.push_back(session);
    if (given.IsStatic()) AddStaticPoints(input, session, &*known);
  }
  if (targets.size() == 1) targets.front().session_ids.clear();
  std::ranges::stable_sort(targets, {}, [](const CalibratedTarget& target) {
    return target.given.kind == TargetKind::kWand ? 0 : 1;
  });
  result->target = std::move(targets.front());
  result->other_targets.assign(std::make_move_iterator(targets.begin() + 1),
                               std::make_move_iterator(targets.end()));
}

}  // namespace

absl::StatusOr<CalibrationResult> ReportCalibration(const ReportInput& input,
                                                    RefusalCounter* refused,
                                                    std::vector<FoundCourse>* courses) {
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  CountWhatWasLeftOut(input, refused);
  const std::vector<Residuals> residuals = ComputeResiduals(problem);
  const ClockReport clocks = ReportClocks(input.rig, input.evaluated);
  CalibrationResult result;
  result.scale_known = !problem.distance || input.options.known_distance;
  if (!result.scale_known) {
    result.unit_camera = problem.cameras[static_cast<size_t>(problem.distance->camera_b)].name;
  }
  const HeldRig* const held = input.evaluated.options.held.get();
  const bool has_own_frame = held != nullptr && held->keeps_frame;
  if (!has_own_frame) {
    result.reference_camera =
        problem.cameras[static_cast<size_t>(input.evaluated.options.reference_camera)].name;
  }
  result.iteration_count = static_cast<uint32_t>(input.evaluated.solution.iterations);
  result.trajectory = ReportTrajectory(input);
  result.solver_path = NeedsGeneralPath(problem) ? SolverPath::kGeneral : SolverPath::kLineKernel;
  for (const BundleInstant& instant : problem.instants) {
    result.instant_count += instant.used ? 1 : 0;
  }
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const BundleCamera& solved = problem.cameras[c];
    const CameraDescription& description = input.rig.index.cameras[c];
    const size_t track = FirstTrack(input.rig.index, c);
    const auto k = static_cast<size_t>(input.rig.index.clock_of_track[track]);
    CalibratedCamera camera;
    camera.camera = solved.name;
    camera.image_size_px = description.image_size_px;
    camera.cam_from_rig = solved.cam_from_rig;
    camera.cam_from_rig.rotation = Canonical(camera.cam_from_rig.rotation);
    camera.intrinsics = solved.intrinsics_fixed ? *description.intrinsics
                                                : FromVector(solved.model, solved.intrinsics);
    camera.intrinsics_refined = !solved.intrinsics_fixed;
    camera.clock_id = description.clock.clock_id;
    camera.time_offset_s = clocks.offset_s[k];
    camera.time_rate_ppm = 1e6 * clocks.rate[k];
    camera.time_epoch_s =
        1e-9 * static_cast<double>(input.evaluated.solution.clocks[k].time_epoch_ns);
    // What does not move says nothing of a clock.
    camera.time_offset_estimated =
        input.evaluated.options.estimate_time_offsets && !input.rig.tracks[track].is_static;
    camera.clock_course = input.rig.tracks[track].clock_course;
    const RigSolution& solution = input.evaluated.solution;
    camera.line_delay_s = solution.line_delay_s[c] + solved.line_delay_s;
    if (input.evaluated.uncertainty) {
      const RigUncertainty& known = *input.evaluated.uncertainty;
      const Eigen::Index row =
          known.Row({ReducedParameterKind::kLineDelay, static_cast<int>(c), 0});
      if (row >= 0) camera.line_delay_sigma_s = std::sqrt(known.covariance(row, row));
    }
    camera.residuals = residuals[c];
    if (input.evaluated.held_out) {
      const EvaluatedErrors& held_out = *input.evaluated.held_out;
      camera.held_out = Figures(held_out.reprojection_px[c]);
      if (!held_out.leave_one_out_px[c].empty()) {
        camera.leave_one_out = Figures(held_out.leave_one_out_px[c]);
      }
    }
    if (input.evaluated.uncertainty) {
      camera.uncertainty = input.evaluated.uncertainty->cameras[c];
      camera.uncertainty->time_offset_sigma_s = clocks.offset_sigma_s[k];
      camera.uncertainty->time_rate_sigma_ppm = 1e6 * clocks.rate_sigma[k];
    }
    const CameraCounts& counts = input.counts.at(solved.name);
    camera.observation_count = counts.observation_count;
    camera.wand_count = counts.wand_count;
    if (camera.residuals.observation_count < kMinObservations ||
        !camera.cam_from_rig.translation_m.allFinite() ||
        !camera.cam_from_rig.rotation.coeffs().allFinite()) {
      return absl::FailedPreconditionError(absl::StrCat(
          "camera ", camera.camera, " could not be placed: ", camera.residuals.observation_count,
          " of its ", counts.wand_count,
          " wand views agree with the other cameras; wave the wand longer where it and another "
          "camera both see it"));
    }
    result.cameras.push_back(std::move(camera));
  }
  ReportTargets(input, &result);
  if (result.scale_known) result.wand_volume = MeasureWandVolume(problem);
  if (input.evaluated.uncertainty) {
    result.camera_covariance =
        PackCameraCovariance(problem, has_own_frame ? -1 : input.evaluated.options.reference_camera,
                             *input.evaluated.uncertainty);
  }
  result.residuals = CollectResiduals(problem);
  for (size_t c = 0; c < result.residuals.size(); ++c) {
    result.residuals[c].image_size_px = result.cameras[c].image_size_px;
  }
  Causes causes = FindCauses(input.rig, input.evaluated, result);
  const PredictedError& predicted = input.evaluated.predicted;
  result.findings = FindingsOf(causes, IsBadByFigures(result, predicted));
  for (Finding& finding : result.findings) finding.severity = SeverityOf(result, finding);
  result.quality = GradeQuality(result, predicted);
  result.observation_digest = Digest(input);
  *courses = std::move(causes.courses);
  return result;
}

}  // namespace rigcal::server
