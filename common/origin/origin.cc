// SPDX-License-Identifier: Apache-2.0
#include "common/origin/origin.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/origin/frame_fit.h"

namespace rigcal {
namespace {

constexpr double kMmPerM = 1000;
constexpr double kDegPerRad = 57.29577951308232;
// Points whose second direction is so much shorter than the first are on a line, whatever their
// noise says.
constexpr double kLineShare = 0.02;
// Camera centres within so many of their distances from a plane are in it.
constexpr double kInPlaneShare = 0.03;
// A mirror image that fits so much better than the points themselves is what was given.
constexpr double kMirrorGain = 3;

absl::Status Weak(const std::string& why) { return absl::FailedPreconditionError(why); }

absl::Status CheckSpread(const std::vector<Eigen::Vector3d>& points_m, const char* which) {
  if (points_m.size() < 3) {
    return Weak(absl::StrFormat("%d %s: three that are not on one line are needed", points_m.size(),
                                which));
  }
  const PlaneFit plane = FitPlane(points_m, std::vector<double>(points_m.size(), 1));
  if (plane.spread_m[1] < kLineShare * plane.spread_m[0] || plane.spread_m[1] < 1e-3) {
    return Weak(absl::StrFormat(
        "the %d %s are on one line: they spread %.0f mm along it and %.1f mm across, which leaves "
        "the turn about the line open; lay the target down at another angle, or name a point "
        "beside the line",
        points_m.size(), which, kMmPerM * plane.spread_m[0], kMmPerM * plane.spread_m[1]));
  }
  return absl::OkStatus();
}

std::vector<Eigen::Vector3d> PositionsOf(const std::vector<OriginPoint>& points) {
  std::vector<Eigen::Vector3d> positions_m;
  for (const OriginPoint& point : points) positions_m.push_back(point.position_m);
  return positions_m;
}

std::vector<Eigen::Matrix3d> CovariancesOf(const std::vector<OriginPoint>& points) {
  std::vector<Eigen::Matrix3d> covariances;
  for (const OriginPoint& point : points) {
    covariances.push_back(point.noise_m2 +
                          point.sigma_m * point.sigma_m * Eigen::Matrix3d::Identity());
  }
  return covariances;
}

double PointSigmaM(const OriginPoint& point) {
  return std::sqrt(point.noise_m2.trace() / 3 + point.sigma_m * point.sigma_m);
}

// The frame by a fit of the points, with its derivatives.
OriginSolution Solve(const CalibrationResult& calibration, const std::vector<OriginPoint>& points,
                     const FrameOfPoints& frame_of) {
  OriginSolution solution;
  const std::vector<Eigen::Vector3d> positions_m = PositionsOf(points);
  solution.change.new_from_rig = frame_of(positions_m);
  const FrameDerivatives by_points = Differentiate(frame_of, positions_m);
  const std::vector<Eigen::Matrix3d> covariances = CovariancesOf(points);
  for (size_t i = 0; i < points.size(); ++i) {
    const auto own = by_points.middleCols<3>(static_cast<Eigen::Index>(3 * i));
    solution.change.own_covariance += own * covariances[i] * own.transpose();
    if (points[i].gain.cols() == 0) continue;
    if (solution.change.by_parameters.cols() == 0) {
      solution.change.by_parameters.setZero(6, points[i].gain.cols());
    }
    solution.change.by_parameters += own * points[i].gain;
  }
  const Eigen::Matrix<double, 6, 6> covariance =
      solution.change.Covariance(UnpackCameraCovariance(calibration));
  solution.rotation_sigma_rad = covariance.diagonal().head<3>().cwiseMax(0).cwiseSqrt();
  solution.position_sigma_m = covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
  solution.lowest_camera_m = std::numeric_limits<double>::infinity();
  for (const CalibratedCamera& camera : calibration.cameras) {
    const Eigen::Vector3d centre =
        solution.change.new_from_rig * camera.cam_from_rig.SourceFromTargetTranslation();
    if (centre.z() >= solution.lowest_camera_m) continue;
    solution.lowest_camera_m = centre.z();
    solution.lowest_camera = camera.camera;
  }
  return solution;
}

void SetRms(OriginSolution* solution) {
  double sum = 0;
  for (const OriginSolution::Residual& residual : solution->residuals) {
    sum += residual.residual_m * residual.residual_m;
  }
  solution->rms_m = std::sqrt(sum / static_cast<double>(solution->residuals.size()));
}

std::string WorstOf(const OriginSolution& solution) {
  const auto worst = std::ranges::max_element(
      solution.residuals, {}, [](const auto& residual) { return std::abs(residual.residual_m); });
  return absl::StrFormat("%s is %.1f mm off", worst->name, kMmPerM * std::abs(worst->residual_m));
}

absl::Status CheckFit(const OriginSolution& solution, const OriginOptions& options,
                      const char* what) {
  if (!(solution.rms_m <= options.max_residual_m)) {
    return Weak(absl::StrFormat("%s: %.1f mm rms, at most %.1f mm is accepted; %s", what,
                                kMmPerM * solution.rms_m, kMmPerM * options.max_residual_m,
                                WorstOf(solution)));
  }
  const double sigma_deg = kDegPerRad * solution.rotation_sigma_rad.maxCoeff();
  if (!(sigma_deg <= options.max_rotation_sigma_deg)) {
    const Eigen::Vector3d sigmas_deg = kDegPerRad * solution.rotation_sigma_rad;
    return Weak(absl::StrFormat(
        "the points determine the axes weakly: one sigma is %.2f, %.2f and %.2f degrees about x, y "
        "and z, at most %.2f is accepted; use points further apart, or more of them",
        sigmas_deg.x(), sigmas_deg.y(), sigmas_deg.z(), options.max_rotation_sigma_deg));
  }
  return absl::OkStatus();
}

// How far camera centres are from a plane, by side.
absl::Status CheckSide(const CalibrationResult& calibration, const PlaneFit& plane) {
  double highest_m = 0, away_m = 0;
  int above = 0, below = 0;
  std::string low, high;
  for (const CalibratedCamera& camera : calibration.cameras) {
    const Eigen::Vector3d from = camera.cam_from_rig.SourceFromTargetTranslation() - plane.centre_m;
    const double height_m = plane.normal.dot(from);
    away_m = std::max(away_m, from.norm());
    highest_m = std::max(highest_m, std::abs(height_m));
    (height_m > 0 ? above : below) += 1;
    absl::StrAppendFormat(height_m > 0 ? &high : &low, " %s (%.2f m)", camera.camera,
                          std::abs(height_m));
  }
  if (highest_m < kInPlaneShare * away_m) {
    return Weak(absl::StrFormat(
        "the points and the cameras are in one plane: no camera is further than %.0f mm from it, "
        "at distances up to %.1f m, so that nobody can tell which side is up",
        kMmPerM * highest_m, away_m));
  }
  if (above > 0 && below > 0) {
    return Weak(
        absl::StrCat("the plane of the points goes through between the cameras: on one side", high,
                     ", on the other", low,
                     "; a floor has all cameras above it. Is a point not on the floor? For a plane "
                     "that is none, "
                     "use points with known coordinates"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<OriginSolution> FloorOrigin(const CalibrationResult& calibration,
                                           const std::vector<OriginPoint>& points, size_t first,
                                           size_t second, double height_m,
                                           const OriginOptions& options) {
  const std::vector<Eigen::Vector3d> positions_m = PositionsOf(points);
  if (absl::Status spread = CheckSpread(positions_m, "points on the floor"); !spread.ok()) {
    return spread;
  }
  PlaneFit plane = FitPlane(positions_m, std::vector<double>(points.size(), 1));
  // Each point weighs as well as its height is known.
  std::vector<double> weights;
  for (const Eigen::Matrix3d& covariance : CovariancesOf(points)) {
    const double variance = plane.normal.dot(covariance * plane.normal);
    weights.push_back(1 / std::max(variance, 1e-12));
  }
  plane = FitPlane(positions_m, weights);
  if (absl::Status side = CheckSide(calibration, plane); !side.ok()) return side;
  const Eigen::Vector3d inside = calibration.cameras[0].cam_from_rig.SourceFromTargetTranslation();
  const FrameOfPoints frame_of = [&](const std::vector<Eigen::Vector3d>& at) {
    return FloorFrame(at, weights, first, second, height_m, inside);
  };
  OriginSolution solution = Solve(calibration, points, frame_of);
  for (size_t i = 0; i < points.size(); ++i) {
    const double height = (solution.change.new_from_rig * points[i].position_m).z() - height_m;
    solution.residuals.push_back({points[i].name, height, PointSigmaM(points[i])});
  }
  SetRms(&solution);
  if (absl::Status fit = CheckFit(solution, options, "the points are not on one plane");
      !fit.ok()) {
    return fit;
  }
  return solution;
}

absl::StatusOr<OriginSolution> PointOrigin(const CalibrationResult& calibration,
                                           const std::vector<OriginPoint>& points,
                                           const std::vector<Eigen::Vector3d>& known_m,
                                           const OriginOptions& options) {
  const std::vector<Eigen::Vector3d> positions_m = PositionsOf(points);
  if (absl::Status spread = CheckSpread(positions_m, "named points"); !spread.ok()) return spread;
  if (absl::Status spread = CheckSpread(known_m, "given points"); !spread.ok()) return spread;
  std::vector<double> weights;
  for (const OriginPoint& point : points) {
    weights.push_back(1 / std::max(PointSigmaM(point) * PointSigmaM(point), 1e-12));
  }
  const FrameOfPoints frame_of = [&](const std::vector<Eigen::Vector3d>& at) {
    return AlignPoints(at, known_m, weights);
  };
  OriginSolution solution = Solve(calibration, points, frame_of);
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d error = solution.change.new_from_rig * points[i].position_m - known_m[i];
    solution.residuals.push_back({points[i].name, error.norm(), PointSigmaM(points[i])});
  }
  SetRms(&solution);
  // The mirror image of what was given: z turned round.
  std::vector<Eigen::Vector3d> mirrored_m = known_m;
  for (Eigen::Vector3d& point : mirrored_m) point.z() = -point.z();
  const RigidTransform mirror = AlignPoints(positions_m, mirrored_m, weights);
  double mirror_sum = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    mirror_sum += (mirror * positions_m[i] - mirrored_m[i]).squaredNorm();
  }
  const double mirror_rms_m = std::sqrt(mirror_sum / static_cast<double>(points.size()));
  if (solution.rms_m > options.max_residual_m && solution.rms_m > kMirrorGain * mirror_rms_m) {
    return Weak(absl::StrFormat(
        "the given points are mirrored: they fit with %.1f mm rms, and with one axis turned round "
        "with %.1f mm; axes are right-handed (x to y is anticlockwise seen from where z points)",
        kMmPerM * solution.rms_m, kMmPerM * mirror_rms_m));
  }
  if (absl::Status fit = CheckFit(solution, options, "the points do not fit their coordinates");
      !fit.ok()) {
    return fit;
  }
  const PlaneFit plane = FitPlane(known_m, std::vector<double>(known_m.size(), 1));
  const bool flat = plane.spread_m[2] < 0.02 * plane.spread_m[1];
  if (options.cameras_above && flat && std::abs(plane.normal.z()) > 0.99 &&
      solution.lowest_camera_m < plane.centre_m.z()) {
    return Weak(absl::StrFormat(
        "camera %s comes to lie %.2f m below the plane of the given points: they are mirrored (x "
        "and y swapped, or z down), which points of one plane cannot tell by their residuals "
        "(%.1f mm rms); if the camera is below, say so",
        solution.lowest_camera, plane.centre_m.z() - solution.lowest_camera_m,
        kMmPerM * solution.rms_m));
  }
  return solution;
}

absl::StatusOr<OriginSolution> LevelOrigin(const CalibrationResult& calibration,
                                           const Eigen::Vector3d& down) {
  if (!down.allFinite() || !(down.norm() > 1e-9)) {
    return absl::InvalidArgumentError("the direction of gravity is none: it has no length");
  }
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond::FromTwoVectors(-down, Eigen::Vector3d::UnitZ());
  return GivenOrigin(calibration, {turn.normalized(), Eigen::Vector3d::Zero()});
}

OriginSolution GivenOrigin(const CalibrationResult& calibration,
                           const RigidTransform& new_from_rig) {
  return Solve(calibration, {}, [&](const std::vector<Eigen::Vector3d>&) { return new_from_rig; });
}

}  // namespace rigcal
