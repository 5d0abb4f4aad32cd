// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/time_check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/clocks/ray_paths.h"
#include "server/solve/geometry/null_vector.h"
#include "server/solve/geometry/triangulation.h"

namespace rigcal::server {
namespace {

constexpr double kNoScore = std::numeric_limits<double>::infinity();
constexpr double kCheckReachS = 1.0;
constexpr double kCheckStepS = 0.01;
constexpr double kCheckFineStepS = 0.001;
constexpr size_t kCheckedInstants = 120;
constexpr size_t kMinPoints = 60;
// A clock that is matched this well is not checked.
constexpr double kContentPx = 2;
// Another offset is better when it scores this share of the present one, and this.
constexpr double kBetterShare = 0.4;
constexpr double kBetterPx = 3;
constexpr double kPointsAgreePx = 5;
constexpr int kCheckReweightings = 4;
constexpr size_t kCheckDescents = 6;
constexpr double kMinCheckedShare = 0.6;

// A marker in the rig frame, from the other clocks' cameras.
struct TimedPoint {
  int marker;
  double time_s;  // rig time, from the first instant
  Eigen::Vector3d x_in_rig;
};

// A marker as the cameras of other clocks triangulate it, where they agree.
std::optional<Eigen::Vector3d> PointWithout(const BundleProblem& problem,
                                            const std::vector<Intrinsics>& intrinsics,
                                            const BundleInstant& instant, int marker, int clock) {
  std::vector<CameraRay> views;
  double focal_px = 1;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    if (observation.clock == clock) continue;
    const BundleCamera& camera = problem.CameraOf(observation);
    for (const BundleMarker& seen : problem.MarkersOf(observation)) {
      if (seen.marker != marker) continue;
      const auto ray =
          Undistort(intrinsics[static_cast<size_t>(observation.camera)], seen.centre_px);
      if (ray.ok()) views.push_back({camera.cam_from_rig, *ray});
      focal_px = camera.intrinsics[0];
    }
  }
  std::optional<Eigen::Vector3d> point = Triangulate(views);
  const bool agree = point && std::ranges::all_of(views, [&](const CameraRay& view) {
                       return RayError(view, *point) * focal_px < kPointsAgreePx;
                     });
  return agree ? point : std::nullopt;
}

std::vector<TimedPoint> PointsWithout(const RigObservations& rig, const RigSolution& solution,
                                      int clock, int64_t origin_ns) {
  const BundleProblem& problem = solution.built.problem;
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  const std::string& session = solution.clocks[static_cast<size_t>(clock)].session_id;
  std::vector<size_t> usable;
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const int track = solution.instants.instants[i].members.front().track;
    if (rig.tracks[static_cast<size_t>(track)].track.session_id == session) usable.push_back(i);
  }
  std::vector<TimedPoint> points;
  const size_t samples = std::min(usable.size(), kCheckedInstants);
  const TargetParts parts = rig.Parts();
  const TargetParts::Part& part = parts.Of(session);
  for (size_t k = 0; k < samples; ++k) {
    const size_t i = usable[k * usable.size() / samples];
    const auto time_ns = static_cast<double>(solution.built.instant_time_ns[i] - origin_ns);
    for (int m = 0; m < part.target.marker_count(); ++m) {
      const auto point =
          PointWithout(problem, intrinsics, problem.instants[i], part.first_marker + m, clock);
      if (point) points.push_back({m, 1e-9 * time_ns, *point});
    }
  }
  return points;
}

std::vector<PointAndRay> SightsAt(const std::vector<TimedPoint>& points, const TrackPaths& paths,
                                  double offset_s) {
  std::vector<PointAndRay> sights;
  for (const TimedPoint& point : points) {
    const auto ray =
        At(paths.markers[static_cast<size_t>(point.marker)], point.time_s - offset_s, paths.gap_s);
    if (ray) sights.push_back({point.x_in_rig, *ray});
  }
  return sights;
}

// Median error of the projection that fits best, in rays.
double ResectionError(std::vector<PointAndRay> sights) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const PointAndRay& sight : sights)
    middle += sight.x_in_rig / static_cast<double>(sights.size());
  double spread = 1e-9;
  for (const PointAndRay& sight : sights)
    spread = std::max(spread, (sight.x_in_rig - middle).norm());
  std::vector<double> weights(sights.size(), 1), errors(sights.size(), 0);
  double median = kNoScore;
  for (int round = 0; round < kCheckReweightings; ++round) {
    Eigen::Matrix<double, 12, 12> normal = Eigen::Matrix<double, 12, 12>::Zero();
    for (size_t i = 0; i < sights.size(); ++i) {
      const Eigen::Vector4d x = ((sights[i].x_in_rig - middle) / spread).homogeneous();
      for (int axis = 0; axis < 2; ++axis) {
        Eigen::Matrix<double, 12, 1> row = Eigen::Matrix<double, 12, 1>::Zero();
        row.segment<4>(4 * axis) = x;
        row.tail<4>() = -sights[i].ray[axis] * x;
        normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weights[i]);
      }
    }
    const Eigen::Matrix<double, 12, 1> p = NullVector(normal);
    for (size_t i = 0; i < sights.size(); ++i) {
      const Eigen::Vector4d x = ((sights[i].x_in_rig - middle) / spread).homogeneous();
      const Eigen::Vector2d image(p.head<4>().dot(x), p.segment<4>(4).dot(x));
      const double depth = p.tail<4>().dot(x);
      errors[i] = std::abs(depth) > 1e-12 ? (image / depth - sights[i].ray).norm() : 1e6;
    }
    median = UpperMedian(errors);
    for (size_t i = 0; i < sights.size(); ++i) {
      const double share = errors[i] / std::max(2 * median, 1e-12);
      weights[i] = 1 / (1 + share * share);
    }
  }
  return median;
}

// The errors of one track against the others' points, in pixels, by offset.
class TrackScores {
 public:
  TrackScores(const std::vector<TimedPoint>& points, const TrackPaths& paths)
      : points_(points), paths_(paths) {
    const auto here = static_cast<double>(SightsAt(points, paths, 0).size());
    min_sights_ = std::max(kMinPoints, static_cast<size_t>(kMinCheckedShare * here));
  }
  double At(double offset_s) const {
    std::vector<PointAndRay> sights = SightsAt(points_, paths_, offset_s);
    if (sights.size() < min_sights_) return kNoScore;
    return paths_.focal_px * ResectionError(std::move(sights));
  }

 private:
  const std::vector<TimedPoint>& points_;
  const TrackPaths& paths_;
  size_t min_sights_;
};

// Offset and score of the deepest valley.
std::pair<double, double> Deepest(const TrackScores& scores) {
  std::vector<std::pair<double, double>> all;
  const int steps = static_cast<int>(kCheckReachS / kCheckStepS);
  for (int i = -steps; i <= steps; ++i) {
    const double score = scores.At(i * kCheckStepS);
    if (std::isfinite(score)) all.emplace_back(score, i * kCheckStepS);
  }
  std::ranges::sort(all);
  std::pair<double, double> best{0, kNoScore};
  for (size_t i = 0; i < std::min(all.size(), kCheckDescents); ++i) {
    auto [score, offset_s] = all[i];
    for (double step_s = 0.5 * kCheckStepS; step_s >= kCheckFineStepS; step_s *= 0.5) {
      for (const double away_s : {offset_s - step_s, offset_s + step_s}) {
        const double other = scores.At(away_s);
        if (!(other < score)) continue;
        score = other;
        offset_s = away_s;
      }
    }
    if (score < best.second) best = {offset_s, score};
  }
  return best;
}

// Of the tracks on a clock, the one in most instants; -1: it has none.
int TrackOf(const RigObservations& rig, const RigSolution& solution, int clock) {
  int best = -1;
  uint32_t most = 0;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    if (rig.index.clock_of_track[t] != clock || solution.instants.instant_count[t] <= most)
      continue;
    best = static_cast<int>(t);
    most = solution.instants.instant_count[t];
  }
  return best;
}

}  // namespace

std::optional<OffsetDoubt> FindBetterOffset(const RigObservations& rig,
                                            const RigSolution& solution) {
  std::optional<OffsetDoubt> doubt;
  if (solution.built.instant_time_ns.empty()) return doubt;
  const int64_t origin_ns = solution.built.instant_time_ns.front();
  const auto times = RigTimes(rig.tracks, rig.index, InitializationFrom(solution).clocks);
  for (int k = 0; k < static_cast<int>(solution.clocks.size()); ++k) {
    const int track = TrackOf(rig, solution, k);
    if (track < 0) continue;
    const auto t = static_cast<size_t>(track);
    const std::vector<TimedPoint> points = PointsWithout(rig, solution, k, origin_ns);
    const TrackPaths paths =
        PathsOf(rig.tracks[t], times[t], origin_ns, rig.TargetOf(t).marker_count());
    const TrackScores scores(points, paths);
    const double here_px = scores.At(0);
    if (!std::isfinite(here_px) || here_px < kContentPx) continue;
    const auto [offset_s, there_px] = Deepest(scores);
    if (there_px > kBetterPx || there_px > kBetterShare * here_px) continue;
    if (doubt && here_px - there_px <= doubt->here_px - doubt->there_px) continue;
    doubt = OffsetDoubt{k, offset_s, here_px, there_px};
  }
  return doubt;
}

}  // namespace rigcal::server
