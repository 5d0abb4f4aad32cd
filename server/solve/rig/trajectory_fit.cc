// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/trajectory_fit.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/rig/line_delay_limit.h"
#include "server/solve/rig/rig_solver.h"
#include "server/solve/rig/sphere_centres.h"

namespace rigcal::server {
namespace {

constexpr double kMaxPauseS = 1;    // between instants that one path joins
constexpr double kOverhangS = 0.1;  // of a path over its first and last instant
constexpr size_t kMinPathInstants = 5;
// Two knots for each moment at which somebody saw the target: what is left out by so fine a grid is
// less than a tenth of a pixel of anything that a hand moves.
constexpr double kKnotsPerMoment = 2;
constexpr double kMinStepS = 0.02, kMaxStepS = 0.04;
constexpr double kSameMomentS = 0.002;
// For initial values: sigmas of a placed instant, and what a hand does in a second cubed.
constexpr double kInstantSigmaM = 0.003, kInstantSigmaRad = 0.02;
constexpr double kJerkMS3 = 100, kJerkRadS3 = 500;
constexpr int kMaxPathRounds = 4;  // of solve and classify
constexpr double kPathCoarseTolerance = 1e-5, kPathTolerance = 1e-7;
constexpr int kMaxPathIterations = 60;
constexpr double kMaxPathBytes = 500e6;      // of its matrices
constexpr double kMaxColumnsPerCamera = 18;  // pose, intrinsics, clock, line delay

// An instant of the discrete solution.
struct PlacedInstant {
  double time_s;
  const BundleInstant* pose;
};

class PathBuilder {
 public:
  PathBuilder(const RigObservations& rig, const RigSolveOptions& options,
              const RigSolution& solution)
      : rig_(rig), options_(options), solution_(solution), discrete_(solution.built.problem) {
    origin_ns_ = solution.built.instant_time_ns.front();
  }

  absl::StatusOr<TrajectoryFit> Build() {
    AdoptRig();
    KnowMarkers();
    std::map<std::string, std::vector<size_t>> tracks_of_session;
    for (size_t t = 0; t < rig_.tracks.size(); ++t) {
      tracks_of_session[rig_.tracks[t].track.session_id].push_back(t);
    }
    std::vector<Run> runs;
    double length_s = 0, moments = 0;
    for (const auto& [session, tracks] : tracks_of_session) {
      for (Run& run : RunsOf(session)) {
        FindRows(tracks, &run);
        length_s += run.end_s - run.begin_s;
        moments += CountMoments(run);
        runs.push_back(std::move(run));
      }
    }
    const double step_s =
        std::clamp(length_s / std::max(1.0, moments) / kKnotsPerMoment, kMinStepS, kMaxStepS);
    for (const Run& run : runs) AddRun(run, step_s);
    if (fit_.problem.spans.empty()) {
      return absl::FailedPreconditionError(
          "trajectory: the target is placed too rarely to follow its path");
    }
    double knots = 0;
    for (const TrajectorySpan& span : fit_.problem.spans) {
      knots += static_cast<double>(span.knots.size());
    }
    const double columns = kMaxColumnsPerCamera * static_cast<double>(discrete_.cameras.size());
    if (knots * columns * sizeof(double) > kMaxPathBytes) {
      return absl::FailedPreconditionError(
          "trajectory: the recording is too long for a path with so many cameras");
    }
    CorrectCentres();
    return std::move(fit_);
  }

 private:
  struct Row {
    double time_s;
    size_t track, row;
  };
  // A part of a session through which the target is followed.
  struct Run {
    double begin_s, end_s;
    std::vector<PlacedInstant> instants;
    std::vector<Row> rows;  // ascending
  };

  void AdoptRig() {
    BundleProblem& rows = fit_.problem.rows;
    rows.cameras = discrete_.cameras;
    rows.clocks = discrete_.clocks;
    rows.target = discrete_.target;
    rows.distance = discrete_.distance;
    times_ns_ = RigTimes(rig_.tracks, rig_.index, solution_.clocks, &solution_.motions);
  }

  // By track, row and label: whether the discrete solution used it; none: it did not look at it.
  void KnowMarkers() {
    known_.resize(rig_.tracks.size());
    for (const BundleInstant& instant : discrete_.instants) {
      if (!instant.used) continue;
      for (const BundleObservation& observation : discrete_.ObservationsOf(instant)) {
        for (const BundleMarker& marker : discrete_.MarkersOf(observation)) {
          const MarkerSource& source = solution_.built.sources[discrete_.IndexOf(marker)];
          known_[static_cast<size_t>(source.track)][{source.observation, marker.marker}] =
              marker.used;
        }
      }
    }
  }

  std::vector<Run> RunsOf(const std::string& session) const {
    std::vector<PlacedInstant> placed;
    for (size_t i = 0; i < discrete_.instants.size(); ++i) {
      if (!discrete_.instants[i].used) continue;
      const int track = solution_.instants.instants[i].members.front().track;
      if (rig_.tracks[static_cast<size_t>(track)].track.session_id != session) continue;
      placed.push_back({Seconds(solution_.built.instant_time_ns[i]), &discrete_.instants[i]});
    }
    std::ranges::stable_sort(placed, {}, &PlacedInstant::time_s);
    std::vector<Run> runs;
    for (const PlacedInstant& instant : placed) {
      if (runs.empty() || instant.time_s - runs.back().instants.back().time_s > kMaxPauseS) {
        runs.push_back({instant.time_s - kOverhangS, 0, {}, {}});
      }
      runs.back().end_s = instant.time_s + kOverhangS;
      runs.back().instants.push_back(instant);
    }
    std::erase_if(runs, [](const Run& run) { return run.instants.size() < kMinPathInstants; });
    return runs;
  }

  double Seconds(int64_t rig_time_ns) const {
    return 1e-9 * static_cast<double>(rig_time_ns - origin_ns_);
  }

  void FindRows(const std::vector<size_t>& tracks, Run* run) const {
    for (const size_t t : tracks) {
      const ObservationTable& table = rig_.tracks[t].track.observations;
      for (size_t i = 0; i < table.size(); ++i) {
        const double time_s = Seconds(times_ns_[t][i]);
        if (time_s < run->begin_s || time_s > run->end_s || !table.AnyVisible(i)) continue;
        if (options_.keep_instant && !options_.keep_instant(times_ns_[t][i])) continue;
        run->rows.push_back({time_s, t, i});
      }
    }
    std::ranges::stable_sort(run->rows, {}, &Row::time_s);
  }

  static double CountMoments(const Run& run) {
    double moments = run.rows.empty() ? 0 : 1;
    for (size_t i = 1; i < run.rows.size(); ++i) {
      moments += run.rows[i].time_s - run.rows[i - 1].time_s > kSameMomentS ? 1 : 0;
    }
    return moments;
  }

  void AddRun(const Run& run, double step_s) {
    if (run.rows.empty()) return;
    TrajectorySpan span;
    span.begin_s = run.begin_s;
    span.step_s = step_s;
    span.size = discrete_.target.marker_positions_m.size() > 1 ? TrajectorySpan::kLineSize
                                                               : TrajectorySpan::kPointSize;
    FitInitial(run.instants, run.end_s, &span);
    fit_.problem.spans.push_back(std::move(span));
    for (const Row& row : run.rows) AddRow(row.track, row.row);
  }

  void FitInitial(const std::vector<PlacedInstant>& instants, double end_s, TrajectorySpan* span) {
    std::vector<double> times_s;
    Eigen::MatrixXd origins(3, static_cast<Eigen::Index>(instants.size())), directions = origins;
    for (size_t i = 0; i < instants.size(); ++i) {
      times_s.push_back(instants[i].time_s);
      origins.col(static_cast<Eigen::Index>(i)) = instants[i].pose->origin_m;
      directions.col(static_cast<Eigen::Index>(i)) = instants[i].pose->direction;
    }
    // White jerk of this root mean square over a tenth of a second.
    const double per_step = std::pow(span->step_s, 2.5) * std::sqrt(0.1);
    fit_.problem.origin_sigma = kJerkMS3 * per_step;
    fit_.problem.direction_sigma = kJerkRadS3 * per_step;
    TrajectorySpan part = *span;
    part.size = 3;
    FitSpan(times_s, origins, kInstantSigmaM, fit_.problem.origin_sigma, end_s, &part);
    if (!span->has_direction()) {
      *span = std::move(part);
      return;
    }
    const Eigen::VectorXd origin_knots = part.knots;
    FitSpan(times_s, directions, kInstantSigmaRad, fit_.problem.direction_sigma, end_s, &part);
    const Eigen::Index count = part.knot_count();
    span->knots.resize(count * span->size);
    for (Eigen::Index k = 0; k < count; ++k) {
      span->knots.segment<3>(k * span->size) = origin_knots.segment<3>(3 * k);
      span->knots.segment<3>(k * span->size + 3) = part.knots.segment<3>(3 * k).normalized();
    }
  }

  void AddRow(size_t track, size_t row) {
    BundleProblem& rows = fit_.problem.rows;
    const AlignedTrack& aligned = rig_.tracks[track];
    const ObservationTable& table = aligned.track.observations;
    const ImageMotion& motion = solution_.motions[track];
    const auto clock = static_cast<size_t>(rig_.index.clock_of_track[track]);
    const ClockCorrection& correction = solution_.clocks[clock];
    BundleObservation observation;
    observation.camera = rig_.index.camera_of_track[track];
    observation.clock = static_cast<int>(clock);
    observation.clock_time_s =
        1e-9 * static_cast<double>(table.time_ns(row) - correction.time_epoch_ns);
    observation.first_marker = static_cast<int>(rows.markers.size());
    const size_t count = table.MarkerCount(row);
    for (size_t m = 0; m < count; ++m) {
      if (!table.IsVisible(row, m)) continue;
      const size_t label = motion.IsFlipped(static_cast<int>(row)) ? count - 1 - m : m;
      Eigen::Matrix2d covariance_px2 = table.covariance_px2(row, m);
      if (options_.sigma_px > 0) {
        covariance_px2 = options_.sigma_px * options_.sigma_px * Eigen::Matrix2d::Identity();
      }
      BundleMarker marker;
      marker.marker = static_cast<int>(label);
      marker.centre_px = table.centre_px(row, m);
      marker.sqrt_information = SqrtInformation(covariance_px2);
      const auto known = known_[track].find({static_cast<int>(row), marker.marker});
      marker.used = known != known_[track].end() && known->second;
      const int64_t camera_time_ns = motion.TimeNs(row, m);
      fit_.problem.time_s.push_back(Seconds(aligned.CoarseRigTimeNs(camera_time_ns)) +
                                    correction.At(camera_time_ns));
      rows.markers.push_back(marker);
      fit_.sources.push_back({static_cast<int>(track), static_cast<int>(row), 1});
    }
    observation.marker_count = static_cast<int>(rows.markers.size()) - observation.first_marker;
    BundleInstant instant;
    instant.first_observation = static_cast<int>(rows.observations.size());
    instant.observation_count = 1;
    rows.observations.push_back(observation);
    rows.instants.push_back(instant);
    fit_.problem.span_of_row.push_back(static_cast<int>(fit_.problem.spans.size()) - 1);
    fit_.row_time_ns.push_back(times_ns_[track][row]);
  }

  // By the distances of the initial path.
  void CorrectCentres() {
    TrajectoryProblem& problem = fit_.problem;
    for (size_t i = 0; i < problem.rows.instants.size(); ++i) {
      const TrajectorySpan& span = problem.spans[static_cast<size_t>(problem.span_of_row[i])];
      const TrajectoryPose pose = PoseAt(span, WeightsAt(span, Seconds(fit_.row_time_ns[i])));
      problem.rows.instants[i].origin_m = pose.origin_m;
      if (span.has_direction()) problem.rows.instants[i].direction = pose.direction;
    }
    BuiltProblem built;
    built.problem = std::move(problem.rows);
    built.sources = std::move(fit_.sources);
    CorrectSphereCentres(rig_.Parts(), rig_.tracks, solution_.motions, IsMetric(rig_, options_),
                         &built);
    problem.rows = std::move(built.problem);
    fit_.sources = std::move(built.sources);
  }

  const RigObservations& rig_;
  const RigSolveOptions& options_;
  const RigSolution& solution_;
  const BundleProblem& discrete_;
  int64_t origin_ns_ = 0;
  std::vector<std::vector<int64_t>> times_ns_;              // by track and row
  std::vector<std::map<std::pair<int, int>, bool>> known_;  // by track; row and label
  TrajectoryFit fit_;
};

// Where the path has the target at the solution's instants, and cameras and clocks as it has them.
RigInitialization InitializationFromPath(const RigSolution& solution, const TrajectoryFit& fit) {
  RigSolution moved;
  moved.clocks = solution.clocks;
  moved.line_delay_s = solution.line_delay_s;
  moved.instants = solution.instants;
  moved.built.problem.cameras = fit.problem.rows.cameras;
  moved.built.problem.clocks = fit.problem.rows.clocks;
  moved.built.problem.target = fit.problem.rows.target;
  moved.built.problem.distance = fit.problem.rows.distance;
  moved.built.problem.instants = solution.built.problem.instants;
  return InitializationFrom(moved);
}

}  // namespace

double TrajectoryFit::KnotStepS() const {
  const auto longest = std::ranges::max_element(problem.spans, {}, &TrajectorySpan::knot_count);
  return longest == problem.spans.end() ? 0 : longest->step_s;
}

double TrajectoryFit::JerkDensity() const {
  // The third difference of a path of white jerk of density q has the variance q h^5.
  const double step_s = KnotStepS();
  return step_s > 0 ? problem.origin_sigma * summary.residual_sigma / std::pow(step_s, 2.5) : 0;
}

absl::StatusOr<RigSolution> SolveOnTrajectory(const RigObservations& rig,
                                              const RigSolveOptions& options,
                                              const RigSolution& solution,
                                              const TrajectoryFit* like) {
  if (NeedsGeneralPath(solution.built.problem)) {
    return absl::FailedPreconditionError("trajectory: rigid targets and several wands have none");
  }
  if (solution.built.problem.instants.empty()) {
    return absl::FailedPreconditionError("trajectory: nothing is placed");
  }
  RIGCAL_ASSIGN_OR_RETURN(TrajectoryFit fit, PathBuilder(rig, options, solution).Build());
  if (like != nullptr) {
    const double longer = std::pow(fit.KnotStepS() / like->KnotStepS(), 2.5);
    fit.problem.origin_sigma = longer * like->problem.origin_sigma;
    fit.problem.direction_sigma = longer * like->problem.direction_sigma;
  }
  BundleOptions bundle;
  bundle.cancelled = options.cancelled;
  bundle.max_iterations = kMaxPathIterations;
  const std::vector<double> longest_s = LongestLineDelays(rig);
  for (int round = 0;; ++round) {
    bundle.function_tolerance = round == 0 ? kPathCoarseTolerance : kPathTolerance;
    RIGCAL_ASSIGN_OR_RETURN(fit.summary, AdjustTrajectory(bundle, &fit.problem));
    const int held =
        round == 0 ? 0 : HoldLongLineDelays(longest_s, solution.line_delay_s, &fit.problem.rows);
    if (round + 1 == kMaxPathRounds) break;
    if (ClassifyOutliersOfPath(bundle, &fit.problem) + held == 0 && round > 0) break;
  }
  RIGCAL_ASSIGN_OR_RETURN(RigSolution placed,
                          PlaceRig(rig, options, InitializationFromPath(solution, fit), solution));
  placed.iterations = solution.iterations + fit.summary.iterations;
  placed.converged = solution.converged && fit.summary.converged;
  placed.trajectory = std::make_shared<const TrajectoryFit>(std::move(fit));
  return placed;
}

}  // namespace rigcal::server
