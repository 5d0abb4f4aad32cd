// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/triangulation_accuracy.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "server/solve/evaluate/calibration_error.h"

namespace rigcal::server {
namespace {

constexpr double kDefaultGridPoints = 400;
constexpr double kMaxRoundTrip = 1e-6;

using Jacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, 18>;

struct Camera {
  const CalibratedCamera* calibrated;
  IntrinsicsVector intrinsics;
  Eigen::Index first_row;
  bool has_pose, has_intrinsics;

  Eigen::Index rows() const {
    return (has_pose ? 6 : 0) + (has_intrinsics ? intrinsics.size() : 0);
  }
};

class Rig {
 public:
  static absl::StatusOr<Rig> Create(const CalibrationResult& calibration) {
    Rig rig;
    Eigen::Index rows = 0;
    for (const CalibratedCamera& calibrated : calibration.cameras) {
      Camera camera{&calibrated, ToVector(calibrated.intrinsics), rows,
                    calibrated.camera != calibration.reference_camera,
                    calibrated.intrinsics_refined};
      rows += camera.rows();
      rig.cameras_.push_back(camera);
    }
    const std::vector<double>& packed = calibration.camera_covariance;
    if (packed.size() != static_cast<size_t>(rows * (rows + 1) / 2) || rows == 0) {
      return absl::FailedPreconditionError(
          "the calibration keeps no covariance of its cameras: it was made by an older version, or "
          "its data do not determine every parameter; calibrate its sessions again");
    }
    rig.covariance_.resize(rows, rows);
    size_t next = 0;
    for (Eigen::Index i = 0; i < rows; ++i) {
      for (Eigen::Index j = 0; j <= i; ++j) {
        rig.covariance_(i, j) = rig.covariance_(j, i) = packed[next++];
      }
    }
    rig.scale_sigma_rel_ = calibration.target.scale_sigma_rel;
    return rig;
  }

  const Eigen::MatrixXd& covariance() const { return covariance_; }

  // `gain_out` is set where the point is determined in every direction: its gain by the
  // calibration's parameters.
  PointAccuracy At(const Eigen::Vector3d& point_m, double sigma_px,
                   Eigen::Matrix3Xd* gain_out) const {
    PointAccuracy accuracy;
    accuracy.point_m = point_m;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    // Derivative of the sum of J^T r by the parameters.
    Eigen::Matrix<double, 3, Eigen::Dynamic> pull =
        Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, covariance_.rows());
    for (const Camera& camera : cameras_) {
      Eigen::Matrix<double, 2, 3> d_point;
      Jacobian d_parameters;
      if (!Linearise(camera, point_m, &d_point, &d_parameters)) continue;
      ++accuracy.camera_count;
      normal += d_point.transpose() * d_point;
      pull.middleCols(camera.first_row, camera.rows()) = d_point.transpose() * d_parameters;
    }
    if (accuracy.camera_count < 2) return accuracy;
    const Eigen::Matrix3d inverse = normal.inverse();
    if (!inverse.allFinite() || !(inverse.diagonal().minCoeff() > 0)) {
      accuracy.camera_count = 1;  // along one line of sight
      return accuracy;
    }
    const Eigen::Matrix<double, 3, Eigen::Dynamic> gain = inverse * pull;
    const Eigen::Vector3d noise = sigma_px * sigma_px * inverse.diagonal();
    const Eigen::Vector3d shape = noise + (gain * covariance_ * gain.transpose()).diagonal();
    const Eigen::Vector3d scale = scale_sigma_rel_ * scale_sigma_rel_ * point_m.cwiseAbs2();
    if (AreRaysApart(normal)) *gain_out = gain;
    accuracy.noise_sigma_m = noise.cwiseSqrt();
    accuracy.shape_sigma_m = shape.cwiseMax(0).cwiseSqrt();
    accuracy.sigma_m = (shape + scale).cwiseMax(0).cwiseSqrt();
    return accuracy;
  }

 private:
  // False where the camera does not see the point.
  static bool Linearise(const Camera& camera, const Eigen::Vector3d& point_m,
                        Eigen::Matrix<double, 2, 3>* d_point, Jacobian* d_parameters) {
    const CalibratedCamera& calibrated = *camera.calibrated;
    const Eigen::Vector3d rotated = calibrated.cam_from_rig.rotation * point_m;
    const Eigen::Vector3d x_in_cam = rotated + calibrated.cam_from_rig.translation_m;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> d_cam;
    IntrinsicsJacobian d_intrinsics;
    if (!Project(calibrated.intrinsics.model, camera.intrinsics.data(), x_in_cam, &pixel, &d_cam,
                 &d_intrinsics)) {
      return false;
    }
    if (!(pixel.x() >= -0.5) || !(pixel.y() >= -0.5) ||
        !(pixel.x() < calibrated.image_size_px.width - 0.5) ||
        !(pixel.y() < calibrated.image_size_px.height - 0.5)) {
      return false;
    }
    // A strong distortion folds what is far outside back into the image.
    const absl::StatusOr<Eigen::Vector2d> ray = Undistort(calibrated.intrinsics, pixel);
    if (!ray.ok() || (*ray - x_in_cam.head<2>() / x_in_cam.z()).norm() > kMaxRoundTrip) {
      return false;
    }
    *d_point = d_cam * calibrated.cam_from_rig.rotation.toRotationMatrix();
    d_parameters->resize(2, camera.rows());
    if (camera.has_pose) {
      Eigen::Matrix3d cross;
      cross << 0, -rotated.z(), rotated.y(), rotated.z(), 0, -rotated.x(), -rotated.y(),
          rotated.x(), 0;
      d_parameters->leftCols<3>() = -d_cam * cross;
      d_parameters->middleCols<3>(3) = d_cam;
    }
    if (camera.has_intrinsics) d_parameters->rightCols(camera.intrinsics.size()) = d_intrinsics;
    return true;
  }

  std::vector<Camera> cameras_;
  Eigen::MatrixXd covariance_;
  double scale_sigma_rel_ = 0;
};

// Points that two cameras see, and how they move with the calibration.
class SeenPoints {
 public:
  explicit SeenPoints(const Rig& rig) : rig_(rig) {}

  // Puts the point behind `list`, if two cameras see it or `always`.
  void Add(const Eigen::Vector3d& point_m, double sigma_px, bool always,
           std::vector<PointAccuracy>* list) {
    Eigen::Matrix3Xd gain;
    const PointAccuracy accuracy = rig_.At(point_m, sigma_px, &gain);
    if (!always && accuracy.camera_count < 2) return;
    list->push_back(accuracy);
    // The largest grids have more than is needed: evenly chosen ones say as much.
    if (gain.size() > 0 && count_++ % stride_ == 0) {
      places_.push_back({list, list->size() - 1});
      points_m_.push_back(point_m);
      noise_m2_.push_back(accuracy.noise_sigma_m.squaredNorm());
      in_frame_m2_.push_back((gain * rig_.covariance()).cwiseProduct(gain).sum());
      gains_.push_back(std::move(gain));
      if (points_m_.size() > kMaxSeen) Thin();
    }
  }

  // Free of the rig's frame. Also written into the points.
  CalibrationError Error() const {
    const auto rows = static_cast<Eigen::Index>(3 * gains_.size());
    PointGainMatrix all(rows, rig_.covariance().cols());
    for (size_t i = 0; i < gains_.size(); ++i) {
      all.middleRows<3>(static_cast<Eigen::Index>(3 * i)) = gains_[i];
    }
    CalibrationError error = ComputeCalibrationError(points_m_, std::move(all), rig_.covariance());
    for (size_t i = 0; i < places_.size(); ++i) {
      (*places_[i].list)[places_[i].index].calibration_sigma_m = error.sigma_m[i];
    }
    return error;
  }
  double NoiseRmsM() const { return std::sqrt(Mean(noise_m2_)); }
  // Of the calibration in the rig's frame.
  double InFrameRmsM() const { return std::sqrt(Mean(in_frame_m2_)); }

 private:
  static constexpr size_t kMaxSeen = 1000;

  static double Mean(const std::vector<double>& values) {
    const double sum = std::accumulate(values.begin(), values.end(), 0.0);
    return values.empty() ? 0 : sum / static_cast<double>(values.size());
  }

  void Thin() {
    stride_ *= 2;
    size_t kept = 0;
    for (size_t i = 0; i < points_m_.size(); i += 2, ++kept) {
      points_m_[kept] = points_m_[i];
      places_[kept] = places_[i];
      gains_[kept] = std::move(gains_[i]);
      noise_m2_[kept] = noise_m2_[i];
      in_frame_m2_[kept] = in_frame_m2_[i];
    }
    noise_m2_.resize(kept);
    in_frame_m2_.resize(kept);
    points_m_.resize(kept);
    places_.resize(kept);
    gains_.resize(kept);
  }

  // Where the accuracy of a point is.
  struct Place {
    std::vector<PointAccuracy>* list;
    size_t index;
  };

  const Rig& rig_;
  size_t count_ = 0, stride_ = 1;
  std::vector<Place> places_;
  std::vector<Eigen::Vector3d> points_m_;
  std::vector<Eigen::Matrix3Xd> gains_;
  std::vector<double> noise_m2_, in_frame_m2_;  // by point: variance, three axes together
};

absl::StatusOr<std::vector<Eigen::Vector3d>> GridPoints(const WandVolume& volume, double step_m) {
  const Eigen::Vector3d size = volume.max_m - volume.min_m;
  double expected = 1;
  for (int i = 0; i < 3; ++i) expected *= std::floor(size[i] / step_m) + 1;
  if (!(expected <= static_cast<double>(AccuracyOptions::kMaxPoints))) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "a grid of %g m over %.2f x %.2f x %.2f m has %.0f points, at most %d are computed; ask "
        "for a wider one",
        step_m, size.x(), size.y(), size.z(), expected, AccuracyOptions::kMaxPoints));
  }
  // Centred, so that both ends are equally far from the volume's sides.
  Eigen::Array3i counts = (size.array() / step_m).floor().cast<int>() + 1;
  const Eigen::Vector3d first =
      0.5 * (volume.min_m + volume.max_m) - 0.5 * step_m * (counts - 1).cast<double>().matrix();
  std::vector<Eigen::Vector3d> points;
  for (int x = 0; x < counts.x(); ++x) {
    for (int y = 0; y < counts.y(); ++y) {
      for (int z = 0; z < counts.z(); ++z) {
        points.push_back(first + step_m * Eigen::Vector3d(x, y, z));
      }
    }
  }
  return points;
}

AccuracySummary Summarise(const Accuracy& accuracy, Eigen::Vector3d PointAccuracy::*sigma) {
  AccuracySummary summary;
  std::vector<double> totals;
  for (const std::vector<PointAccuracy>* list : {&accuracy.points, &accuracy.grid}) {
    for (const PointAccuracy& point : *list) {
      if (point.camera_count < 2) continue;
      totals.push_back((point.*sigma).norm());
      if (totals.size() > 1 && totals.back() <= summary.worst_m) continue;
      summary.worst_m = totals.back();
      summary.worst_point_m = point.point_m;
    }
  }
  if (totals.empty()) return summary;
  summary.count = static_cast<uint32_t>(totals.size());
  summary.median_m = NearestQuantile(&totals, 0.5);
  summary.p95_m = NearestQuantile(&totals, 0.95);
  return summary;
}

}  // namespace

absl::Status AccuracyOptions::Validate() const {
  FaultList faults;
  if (!std::isfinite(grid_step_m) || grid_step_m < 0) {
    faults.Add("grid_step_m is ", grid_step_m, "; it must be 0 or more");
  }
  if (!std::isfinite(sigma_px) || sigma_px <= 0) {
    faults.Add("sigma_px is ", sigma_px, "; it must be more than 0");
  }
  if (points_m.size() > kMaxPoints) {
    faults.Add(points_m.size(), " points; at most ", kMaxPoints, " are computed at a time");
  }
  for (size_t i = 0; i < points_m.size(); ++i) {
    if (points_m[i].allFinite()) continue;
    faults.Add("points_m[", i, "] is not finite");
    break;
  }
  return faults.Result();
}

absl::StatusOr<Accuracy> ComputeAccuracy(const CalibrationResult& calibration,
                                         const AccuracyOptions& options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  if (!calibration.scale_known) {
    return absl::FailedPreconditionError(
        "the scale of the calibration is not known: no error can be given in metres");
  }
  RIGCAL_ASSIGN_OR_RETURN(const Rig rig, Rig::Create(calibration));
  Accuracy accuracy;
  accuracy.scale_sigma_rel = calibration.target.scale_sigma_rel;
  SeenPoints seen(rig);
  for (const Eigen::Vector3d& point_m : options.points_m) {
    seen.Add(point_m, options.sigma_px, true, &accuracy.points);
  }
  if (options.points_m.empty() || options.grid_step_m > 0) {
    if (!calibration.wand_volume) {
      return absl::FailedPreconditionError(
          "the calibration does not hold the volume of the wand: ask for points");
    }
    const WandVolume& volume = *calibration.wand_volume;
    accuracy.grid_step_m = options.grid_step_m;
    if (accuracy.grid_step_m == 0) {
      const Eigen::Vector3d size = (volume.max_m - volume.min_m).cwiseMax(0.01);
      accuracy.grid_step_m = std::cbrt(size.prod() / kDefaultGridPoints);
    }
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<Eigen::Vector3d> points,
                            GridPoints(volume, accuracy.grid_step_m));
    for (const Eigen::Vector3d& point_m : points) {
      seen.Add(point_m, options.sigma_px, false, &accuracy.grid);
    }
  }
  accuracy.shape = Summarise(accuracy, &PointAccuracy::shape_sigma_m);
  accuracy.with_scale = Summarise(accuracy, &PointAccuracy::sigma_m);
  const CalibrationError error = seen.Error();
  accuracy.calibration_p95_m = error.p95_m;
  accuracy.calibration_rms_m = error.rms_m;
  const double in_frame_m = seen.InFrameRmsM();
  accuracy.frame_rms_m =
      std::sqrt(std::max(0.0, in_frame_m * in_frame_m - error.rms_m * error.rms_m));
  accuracy.noise_rms_m = seen.NoiseRmsM();
  return accuracy;
}

}  // namespace rigcal::server
