// SPDX-License-Identifier: Apache-2.0
#include "common/scale/scale_fusion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/triangulate/point_fit.h"

namespace rigcal {
namespace {

constexpr size_t kMinLengths = 5;
constexpr size_t kMaxGains = 200;
constexpr double kMinSigmaRel = 1e-9;

// How the centre of a camera moves with the parameters of the calibration.
Eigen::Matrix3Xd CentreGain(const CalibratedCamera& camera, const CameraParameters& rows,
                            Eigen::Index columns) {
  Eigen::Matrix3Xd gain = Eigen::Matrix3Xd::Zero(3, columns);
  if (!rows.has_pose || columns == 0) return gain;
  const Eigen::Matrix3d back = camera.cam_from_rig.rotation.conjugate().toRotationMatrix();
  const Eigen::Vector3d& t = camera.cam_from_rig.translation_m;
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  gain.middleCols<3>(rows.first_row) = -back * cross;
  gain.middleCols<3>(rows.first_row + 3) = -back;
  return gain;
}

absl::StatusOr<size_t> CameraNamed(const CalibrationResult& calibration, const std::string& name) {
  for (size_t i = 0; i < calibration.cameras.size(); ++i) {
    if (calibration.cameras[i].camera == name) return i;
  }
  return absl::InvalidArgumentError(absl::StrCat("the calibration has no camera ", name));
}

// Of logarithms of ratios.
Eigen::MatrixXd RatioCovariance(const std::vector<ScaleSource>& sources,
                                const CameraCovariance& covariance) {
  const auto count = static_cast<Eigen::Index>(sources.size());
  const Eigen::Index parameters = covariance.matrix.rows();
  Eigen::MatrixXd gains = Eigen::MatrixXd::Zero(count, parameters);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const ScaleSource& source = sources[static_cast<size_t>(i)];
    if (source.gain.size() == parameters && parameters > 0) {
      gains.row(i) = source.gain / source.measured_m;
    }
    const double given = source.given_sigma_m / source.given_m;
    const double noise = source.noise_m / source.measured_m;
    result(i, i) = std::max(given * given + noise * noise, kMinSigmaRel * kMinSigmaRel);
  }
  if (parameters > 0) result += gains * covariance.matrix * gains.transpose();
  return result;
}

// The square of a source's distance in sigmas is what the sum of squares loses without it.
void FindOdd(ScaleFusion* fusion) {
  std::vector<int> order(fusion->residuals.size());
  std::iota(order.begin(), order.end(), 0);
  const auto sigmas = [fusion](int i) {
    return std::abs(fusion->residuals[static_cast<size_t>(i)].from_others_sigmas);
  };
  std::ranges::stable_sort(order, std::greater<>(), sigmas);
  if (order.size() < 2 || sigmas(order[0]) <= kOddSourceSigmas) return;
  const double ahead = sigmas(order[0]) * sigmas(order[0]) - sigmas(order[1]) * sigmas(order[1]);
  fusion->undecided = order.size() == 2 || ahead < kDecidedChiSquare;
  if (fusion->undecided) {
    fusion->suspects[0] = std::min(order[0], order[1]);
    fusion->suspects[1] = std::max(order[0], order[1]);
  } else {
    fusion->odd = order[0];
  }
}

}  // namespace

ScaleFusion FuseScales(const std::vector<ScaleSource>& sources,
                       const CameraCovariance& covariance) {
  const auto count = static_cast<Eigen::Index>(sources.size());
  Eigen::VectorXd change(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const ScaleSource& source = sources[static_cast<size_t>(i)];
    change[i] = std::log(source.given_m / source.measured_m);
  }
  const Eigen::MatrixXd of_changes = RatioCovariance(sources, covariance);
  const Eigen::MatrixXd weight = of_changes.ldlt().solve(Eigen::MatrixXd::Identity(count, count));
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(count);
  const Eigen::VectorXd weighted = weight * ones;
  const double information = ones.dot(weighted);
  const double mean = weighted.dot(change) / information;
  ScaleFusion fusion;
  fusion.factor = std::exp(mean);
  fusion.sigma_rel = std::sqrt(1 / information);
  // A source's distance from the others is the parameter b of the model change = mean + b e_i.
  const Eigen::VectorXd pull = weight * (change - mean * ones);
  for (Eigen::Index i = 0; i < count; ++i) {
    ScaleResidual residual;
    residual.name = sources[static_cast<size_t>(i)].name;
    residual.own_change_rel = std::exp(change[i]) - 1;
    residual.own_sigma_rel = std::sqrt(of_changes(i, i));
    const double own = weight(i, i) - weighted[i] * weighted[i] / information;
    if (count > 1 && own > 0) {
      residual.from_others_rel = std::expm1(pull[i] / own);
      residual.from_others_sigmas = pull[i] / std::sqrt(own);
    }
    fusion.residuals.push_back(std::move(residual));
  }
  FindOdd(&fusion);
  return fusion;
}

absl::StatusOr<ScaleSource> ScaleOfTarget(const CalibrationResult& calibration) {
  const double sigma_rel = calibration.target.scale_sigma_rel;
  if (!(sigma_rel > 0)) {
    return absl::FailedPreconditionError(
        "the calibration does not say how well its target gives the scale");
  }
  // Its length is the unit: 1 m of it.
  return ScaleSource{"the target", 1, sigma_rel, 1, 0, {}};
}

absl::StatusOr<ScaleSource> ScaleOfCameras(const CalibrationResult& calibration,
                                           const CameraCovariance& covariance, const std::string& a,
                                           const std::string& b, double given_m,
                                           double given_sigma_m) {
  const absl::StatusOr<size_t> first = CameraNamed(calibration, a);
  if (!first.ok()) return first.status();
  const absl::StatusOr<size_t> second = CameraNamed(calibration, b);
  if (!second.ok()) return second.status();
  if (*first == *second) {
    return absl::InvalidArgumentError(absl::StrCat("the distance of ", a, " from itself"));
  }
  const CalibratedCamera &camera_a = calibration.cameras[*first],
                         &camera_b = calibration.cameras[*second];
  const Eigen::Vector3d from = camera_b.cam_from_rig.SourceFromTargetTranslation() -
                               camera_a.cam_from_rig.SourceFromTargetTranslation();
  ScaleSource source{
      absl::StrCat("distance ", a, " to ", b), given_m, given_sigma_m, from.norm(), 0, {}};
  const Eigen::Index columns = covariance.matrix.rows();
  if (columns > 0) {
    source.gain = (from / from.norm()).transpose() *
                  (CentreGain(camera_b, covariance.cameras[*second], columns) -
                   CentreGain(camera_a, covariance.cameras[*first], columns));
  }
  return source;
}

absl::StatusOr<ScaleSource> ScaleOfMarkers(const CalibrationResult& calibration,
                                           const CameraCovariance& covariance,
                                           const Triangulation& triangulation, int marker_a,
                                           int marker_b, double given_m, double given_sigma_m) {
  ScaleSource source{
      absl::StrCat("length ", marker_a, " to ", marker_b), given_m, given_sigma_m, 0, 0, {}};
  std::vector<std::pair<const TriangulatedPoint*, const TriangulatedPoint*>> pairs;
  const std::vector<TriangulatedPoint>& points = triangulation.points;
  for (size_t i = 0; i < points.size(); ++i) {
    if (points[i].marker != marker_a) continue;
    for (const int step : {-1, 1}) {
      for (size_t j = i + static_cast<size_t>(step);
           j < points.size() && points[j].rig_time_ns == points[i].rig_time_ns;
           j += static_cast<size_t>(step)) {
        if (points[j].marker == marker_b) pairs.push_back({&points[i], &points[j]});
      }
    }
  }
  if (pairs.size() < kMinLengths) {
    return absl::FailedPreconditionError(
        absl::StrCat("markers ", marker_a, " and ", marker_b, " were triangulated together at ",
                     pairs.size(), " instants; ", kMinLengths, " are needed"));
  }
  const auto count = static_cast<double>(pairs.size());
  double variance = 0, squares = 0;
  const Eigen::Index columns = covariance.matrix.rows();
  if (columns > 0) source.gain.setZero(columns);
  const size_t stride = pairs.size() / kMaxGains + 1;
  double gain_count = 0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    const TriangulatedPoint &a = *pairs[i].first, &b = *pairs[i].second;
    const Eigen::Vector3d from = b.position_m - a.position_m;
    const Eigen::Vector3d along = from.normalized();
    source.measured_m += from.norm() / count;
    squares += from.squaredNorm() / count;
    variance += along.dot((a.noise_m2 + b.noise_m2) * along);
    if (columns == 0 || i % stride != 0) continue;
    const auto fit_a = FitPoint(calibration.cameras, a.views);
    const auto fit_b = FitPoint(calibration.cameras, b.views);
    if (!fit_a || !fit_b) continue;
    source.gain +=
        along.transpose() * (PointGain(calibration.cameras, covariance, b.views, *fit_b) -
                             PointGain(calibration.cameras, covariance, a.views, *fit_a));
    ++gain_count;
  }
  if (gain_count > 0) source.gain /= gain_count;
  // As the centres' noise says, or as the lengths scatter if that is more.
  const double scatter = std::max(0.0, squares - source.measured_m * source.measured_m);
  source.noise_m = std::sqrt(std::max(variance / count, scatter) / count);
  return source;
}

CalibrationResult Rescale(const CalibrationResult& calibration, double factor, double sigma_rel) {
  CalibrationResult scaled = calibration;
  CameraCovariance covariance = UnpackCameraCovariance(calibration);
  for (size_t c = 0; c < scaled.cameras.size(); ++c) {
    CalibratedCamera& camera = scaled.cameras[c];
    camera.cam_from_rig.translation_m *= factor;
    if (camera.uncertainty) camera.uncertainty->position_sigma_m *= factor;
    const CameraParameters& rows = covariance.cameras[c];
    if (covariance.matrix.size() == 0 || !rows.has_pose) continue;
    covariance.matrix.middleRows<3>(rows.first_row + 3) *= factor;
    covariance.matrix.middleCols<3>(rows.first_row + 3) *= factor;
  }
  if (covariance.matrix.size() > 0) scaled.camera_covariance = PackLowerTriangle(covariance.matrix);
  if (scaled.wand_volume) {
    scaled.wand_volume->min_m *= factor;
    scaled.wand_volume->max_m *= factor;
  }
  scaled.quality.predicted_error_m *= factor;
  if (scaled.headline) {
    scaled.headline->point_error_m *= factor;
    scaled.headline->point_error_bound_m *= factor;
  }
  const auto rescale_target = [&](CalibratedTarget* target) {
    for (double& position_m : target->marker_positions_m) position_m *= factor;
    for (CalibratedPoint& point : target->static_points) point.position_m *= factor;
    if (target->scale_sigma_rel > 0) target->scale_sigma_rel = sigma_rel;
  };
  rescale_target(&scaled.target);
  for (CalibratedTarget& target : scaled.other_targets) rescale_target(&target);
  scaled.target.scale_sigma_rel = sigma_rel;
  return scaled;
}

}  // namespace rigcal
