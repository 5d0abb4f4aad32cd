// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/wave_advice.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/line_bundle.h"

namespace rigcal::server {
namespace {

constexpr size_t kComparedPoints = 48;   // of the grid, for each candidate
constexpr size_t kCandidates = 16;       // places
constexpr double kComparedShare = 0.95;  // of the points have this error or a smaller one
constexpr double kMinGain = 0.05;        // of the error
constexpr int kSampleInstants = 8;       // that stand for those of the advice
constexpr double kNoPrior = 1e6;         // times its sigma
constexpr double kMiddleShare = 0.33;    // of the volume's half size: "in the middle"
constexpr double kNearDegrees = 20;      // from the direction of a camera: "towards" it

struct Candidate {
  size_t point;  // index into the grid
  Eigen::Vector3d direction;
  std::vector<std::string> cameras;
  double p95_m;
};

bool Sees(const BundleCamera& camera, const Intrinsics& intrinsics, const ImageSize& size,
          const Eigen::Vector3d& point_m) {
  Eigen::Vector2d pixel;
  const Eigen::Vector3d x_in_cam = camera.cam_from_rig * point_m;
  if (!Project(intrinsics, x_in_cam, &pixel)) return false;
  if (!(pixel.x() >= 0) || !(pixel.y() >= 0) || !(pixel.x() < size.width) ||
      !(pixel.y() < size.height)) {
    return false;
  }
  const auto ray = Undistort(intrinsics, pixel);
  return ray.ok() && (*ray - x_in_cam.head<2>() / x_in_cam.z()).norm() < 1e-6;
}

// Instants with the target around a place, seen by every camera that sees all of it, as exact
// observations of the present estimate. Their scatter is fixed: half a step of the grid in every
// coordinate, and 20 degrees.
BundleProblem AroundPlace(const BundleProblem& solved, const std::vector<Intrinsics>& intrinsics,
                          const std::vector<CameraDescription>& cameras,
                          const Eigen::Vector3d& point_m, const Eigen::Vector3d& direction,
                          double step_m, double sigma_px, std::vector<std::string>* seen_by) {
  BundleProblem problem;
  problem.cameras = solved.cameras;
  problem.clocks = solved.clocks;
  problem.target = solved.target;
  problem.distance = solved.distance;
  const Eigen::Vector3d side = direction.unitOrthogonal(), other = direction.cross(side);
  const std::vector<double>& positions_m = problem.target.marker_positions_m;
  std::vector<bool> sees(cameras.size(), false);
  for (int k = 0; k < kSampleInstants; ++k) {
    const Eigen::Vector3d corner(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
    BundleInstant instant;
    instant.direction = (direction + 0.35 * (corner.x() * side + corner.y() * other)).normalized();
    instant.origin_m =
        point_m + 0.25 * step_m * corner - 0.5 * positions_m.back() * instant.direction;
    instant.first_observation = static_cast<int>(problem.observations.size());
    for (size_t c = 0; c < cameras.size(); ++c) {
      BundleObservation observation;
      observation.camera = static_cast<int>(c);
      observation.first_marker = static_cast<int>(problem.markers.size());
      for (size_t m = 0; m < positions_m.size(); ++m) {
        const Eigen::Vector3d marker_m = instant.origin_m + positions_m[m] * instant.direction;
        if (!Sees(problem.cameras[c], intrinsics[c], cameras[c].image_size_px, marker_m)) break;
        BundleMarker marker;
        Eigen::Vector2d pixel;
        (void)Project(intrinsics[c], problem.cameras[c].cam_from_rig * marker_m, &pixel);
        marker.centre_px = pixel;
        marker.sqrt_information = BundleMarker::Matrix2::Identity() / sigma_px;
        marker.marker = static_cast<int>(m);
        problem.markers.push_back(marker);
        ++observation.marker_count;
      }
      if (observation.marker_count < static_cast<int>(positions_m.size())) {
        problem.markers.resize(static_cast<size_t>(observation.first_marker));
        continue;
      }
      // Which clock makes no difference: the target stands still.
      for (size_t k2 = 0; k2 < problem.clocks.size(); ++k2) {
        if (problem.clocks[k2].offset_fixed) observation.clock = static_cast<int>(k2);
      }
      problem.observations.push_back(observation);
      ++instant.observation_count;
      sees[c] = true;
    }
    if (instant.observation_count < 2) {
      for (int i = 0; i < instant.observation_count; ++i) {
        problem.markers.resize(static_cast<size_t>(problem.observations.back().first_marker));
        problem.observations.pop_back();
      }
      continue;
    }
    problem.instants.push_back(instant);
  }
  for (size_t c = 0; c < cameras.size(); ++c) {
    if (sees[c]) seen_by->push_back(problem.cameras[c].name);
  }
  // What is known already must not count again: no priors.
  for (BundleClock& clock : problem.clocks) clock.offset_sigma_s = clock.rate_sigma = 0;
  for (BundleCamera& camera : problem.cameras) camera.intrinsics_sigma *= kNoPrior;
  problem.target.span_sigma_m *= kNoPrior;
  if (problem.distance) problem.distance->sigma_m *= kNoPrior;
  return problem;
}

// The information of the problem's instants alone, in the order of `parameters`.
std::optional<Eigen::MatrixXd> InformationOf(const BundleProblem& problem,
                                             const std::vector<ReducedParameter>& parameters) {
  BundleOptions options;
  options.robust = false;
  const auto added = ComputeReducedInformation(options, problem);
  if (!added.ok()) return std::nullopt;
  const auto size = static_cast<Eigen::Index>(parameters.size());
  std::vector<Eigen::Index> rows;
  for (const ReducedParameter& parameter : added->parameters) {
    const auto found = std::ranges::find(parameters, parameter);
    rows.push_back(found == parameters.end() ? -1 : found - parameters.begin());
  }
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  for (size_t i = 0; i < rows.size(); ++i) {
    for (size_t j = 0; j < rows.size(); ++j) {
      if (rows[i] < 0 || rows[j] < 0) continue;
      information(rows[i], rows[j]) =
          added->information(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
  }
  return information;
}

// The error of the shape, for comparisons: 95th percentile of sigma over a few points.
class ComparedError {
 public:
  // `scale_row` of the parameters is the length that gives the scale; -1: there is none.
  ComparedError(PointGains gains, Eigen::Index scale_row) {
    const Eigen::Index columns = gains.gain.rows();
    rows_ = Eigen::MatrixXd::Zero(gains.gain.cols(), columns + (scale_row >= 0 ? 1 : 0));
    rows_.leftCols(columns) = gains.gain.transpose();
    has_scale_ = scale_row >= 0;
    if (has_scale_) rows_(scale_row, columns) = 1;
  }

  // With this information about the parameters; infinite where it does not determine them.
  double At(const Eigen::MatrixXd& information) const {
    const Eigen::LLT<Eigen::MatrixXd> factor(information);
    if (factor.info() != Eigen::Success) return INFINITY;
    // Variances are squared lengths of these columns; what goes with the scale is not of the shape.
    Eigen::MatrixXd halves = factor.matrixL().solve(rows_);
    if (has_scale_) {
      const Eigen::VectorXd scale = halves.rightCols<1>().normalized();
      halves -= scale * (scale.transpose() * halves).eval();
    }
    const Eigen::VectorXd squares = halves.colwise().squaredNorm();
    std::vector<double> variances;
    for (Eigen::Index i = 0; i + 2 < squares.size(); i += 3) {
      variances.push_back(squares[i] + squares[i + 1] + squares[i + 2]);
    }
    return std::sqrt(UpperQuantile(&variances, kComparedShare));
  }

 private:
  Eigen::MatrixXd rows_;  // a column for each coordinate of a point, then that of the scale
  bool has_scale_ = false;
};

// Places to try: those with the largest error, not next to each other, then evenly chosen ones.
std::vector<size_t> CandidatePlaces(const WavedGrid& grid, const ExpectedError& error) {
  std::vector<std::pair<double, size_t>> ranked;
  for (size_t i = 0; i < error.points.size(); ++i) {
    ranked.emplace_back(error.sigma_m[i], error.points[i]);
  }
  std::ranges::sort(ranked, std::greater<>());
  std::vector<size_t> places;
  const auto is_near = [&](size_t point) {
    return std::ranges::any_of(places, [&](size_t other) {
      return (grid.Point(point) - grid.Point(other)).norm() < 1.8 * grid.step_m;
    });
  };
  for (const auto& [sigma, point] : ranked) {
    if (places.size() == kCandidates / 2) break;
    if (!is_near(point)) places.push_back(point);
  }
  const size_t stride = std::max<size_t>(1, ranked.size() / (kCandidates / 2));
  for (size_t i = stride / 2; i < ranked.size() && places.size() < kCandidates; i += stride) {
    if (!is_near(ranked[i].second)) places.push_back(ranked[i].second);
  }
  return places;
}

}  // namespace

Eigen::Vector3d EstimateUp(const std::vector<BundleCamera>& cameras) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const BundleCamera& camera : cameras) {
    up -= camera.cam_from_rig.rotation.conjugate() * Eigen::Vector3d::UnitY();
  }
  return up.norm() > 1e-6 ? Eigen::Vector3d(up.normalized())
                          : Eigen::Vector3d(-Eigen::Vector3d::UnitY());
}

std::string DescribePlace(const std::vector<BundleCamera>& cameras, const WavedGrid& grid,
                          const Eigen::Vector3d& point_m, const Eigen::Vector3d& direction,
                          const Eigen::Vector3d& up) {
  const Eigen::Vector3d half =
      0.5 * grid.step_m *
      Eigen::Vector3d(grid.counts[0] - 1, grid.counts[1] - 1, grid.counts[2] - 1);
  const Eigen::Vector3d offset = point_m - (grid.origin_m + half);
  const double half_height = half.cwiseProduct(up.cwiseAbs()).sum();
  const double height = half_height > 0 ? offset.dot(up) / half_height : 0;
  std::string text = height < -kMiddleShare  ? "low"
                     : height > kMiddleShare ? "high"
                                             : "at mid height";
  const auto level = [&up](const Eigen::Vector3d& v) {
    return Eigen::Vector3d(v - v.dot(up) * up);
  };
  const Eigen::Vector3d aside = level(offset);
  const double half_width = (half - half.cwiseProduct(up.cwiseAbs())).norm();
  if (aside.norm() < kMiddleShare * half_width || cameras.size() < 2) {
    text += ", in the middle";
  } else {
    // Cameras by the angle between their direction from the middle and that of the place.
    const Eigen::Vector3d east = aside.normalized(), north = up.cross(east);
    std::vector<std::pair<double, std::string>> left, right;  // degrees
    for (const BundleCamera& camera : cameras) {
      const Eigen::Vector3d to =
          level(-(camera.cam_from_rig.rotation.conjugate() * camera.cam_from_rig.translation_m) -
                (grid.origin_m + half));
      const double degrees = std::atan2(to.dot(north), to.dot(east)) * 180 / M_PI;
      (degrees < 0 ? right : left).emplace_back(std::abs(degrees), camera.name);
    }
    std::ranges::sort(left);
    std::ranges::sort(right);
    const bool is_left =
        !left.empty() && (right.empty() || left.front().first <= right.front().first);
    const auto& [nearest_degrees, nearest] = is_left ? left.front() : right.front();
    const auto& others = is_left ? right : left;
    if (nearest_degrees < kNearDegrees || others.empty() || others.front().first > 120) {
      absl::StrAppend(&text, nearest_degrees < 90 ? ", towards " : ", away from ", nearest);
    } else {
      absl::StrAppend(&text, ", between ", std::min(nearest, others.front().second), " and ",
                      std::max(nearest, others.front().second));
    }
  }
  const double upright = std::abs(direction.dot(up));
  absl::StrAppend(&text, upright > 0.8   ? ", wand upright"
                         : upright < 0.6 ? ", wand level"
                                         : ", wand tilted");
  return text;
}

std::vector<WaveAdvice> AdviseWaving(const RigSolution& solution, const RigUncertainty& uncertainty,
                                     const std::vector<CameraDescription>& cameras,
                                     const WavedGrid& grid, const PointGains& gains,
                                     const ExpectedError& error, double sigma_px, double data_share,
                                     const WaveAdviceOptions& options) {
  const BundleProblem& problem = solution.built.problem;
  PointGains compared = ChoosePoints(gains, kComparedPoints);
  const Eigen::LLT<Eigen::MatrixXd> factor(uncertainty.covariance);
  if (compared.points.empty() || error.p95_m <= 0 || factor.info() != Eigen::Success) return {};
  RemoveRigidMotion(PlacesOf(compared, grid), &compared.gain);
  // All data have more information than those of the solution.
  const Eigen::MatrixXd information =
      factor.solve(
          Eigen::MatrixXd::Identity(uncertainty.covariance.rows(), uncertainty.covariance.cols())) /
      data_share;
  const int last = static_cast<int>(problem.target.marker_positions_m.size()) - 1;
  const ComparedError compare(std::move(compared),
                              uncertainty.Row({ReducedParameterKind::kMarkerPosition, last, 0}));
  const double now_m = compare.At(information);
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  const Eigen::Vector3d up = EstimateUp(problem.cameras);
  const Eigen::Vector3d side = up.unitOrthogonal();
  std::vector<Candidate> candidates;
  for (const size_t place : CandidatePlaces(grid, error)) {
    for (const Eigen::Vector3d& direction : {up, side, Eigen::Vector3d(up.cross(side))}) {
      Candidate candidate{place, direction, {}, now_m};
      const BundleProblem added = AroundPlace(problem, intrinsics, cameras, grid.Point(place),
                                              direction, grid.step_m, sigma_px, &candidate.cameras);
      if (added.instants.empty()) continue;
      const auto more = InformationOf(added, uncertainty.parameters);
      if (!more) continue;
      candidate.p95_m = compare.At(
          information + *more * (options.instants / static_cast<double>(added.instants.size())));
      candidates.push_back(std::move(candidate));
    }
  }
  std::ranges::sort(candidates, {}, &Candidate::p95_m);
  std::vector<WaveAdvice> advice;
  for (const Candidate& candidate : candidates) {
    if (advice.size() == options.max_advice || candidate.p95_m > (1 - kMinGain) * now_m) break;
    const Eigen::Vector3d point_m = grid.Point(candidate.point);
    const bool is_known = std::ranges::any_of(advice, [&](const WaveAdvice& other) {
      return (other.point_m - point_m).norm() < 2.5 * grid.step_m;
    });
    if (is_known) continue;
    advice.push_back({DescribePlace(problem.cameras, grid, point_m, candidate.direction, up),
                      point_m, candidate.direction, candidate.cameras,
                      error.p95_m * candidate.p95_m / now_m});
  }
  return advice;
}

}  // namespace rigcal::server
