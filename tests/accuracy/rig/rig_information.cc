// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/rig_information.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/camera/intrinsics_vector.h"
#include "common/camera/projection.h"
#include "common/status/status_macros.h"
#include "server/associate/static_points.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "tests/accuracy/rig/simulated_tracks.h"

namespace rigcal::accuracy {
namespace {

constexpr int kPoseSize = 6;  // the last is unused with a line target
using InstantBlock = Eigen::Matrix<double, kPoseSize, kPoseSize>;
using PoseColumns = Eigen::Matrix<double, 2, kPoseSize>;

// Sums the information of the instants, with the wand's pose eliminated.
class InformationSum {
 public:
  InformationSum(const TrueRig& rig, const InformationOptions& options, const RigBound& layout,
                 Eigen::Index size)
      : rig_(rig), options_(options), layout_(layout), sum_(Eigen::MatrixXd::Zero(size, size)) {}

  absl::Status Add(const TrueInstant& instant) {
    std::set<int> cameras;
    for (const SeenMarker& seen : instant.markers) cameras.insert(seen.camera);
    if (cameras.size() < 2) return absl::OkStatus();
    Eigen::MatrixXd own = Eigen::MatrixXd::Zero(sum_.rows(), sum_.cols());
    Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(sum_.rows(), kPoseSize);
    InstantBlock wand = InstantBlock::Zero();
    for (const SeenMarker& seen : instant.markers) {
      Eigen::MatrixXd rig_columns = Eigen::MatrixXd::Zero(2, sum_.cols());
      PoseColumns wand_columns;
      RIGCAL_RETURN_IF_ERROR(Linearise(instant, seen, &rig_columns, &wand_columns));
      own += rig_columns.transpose() * rig_columns;
      mixed += rig_columns.transpose() * wand_columns;
      wand += wand_columns.transpose() * wand_columns;
    }
    sum_ += own - mixed * PseudoInverse(wand) * mixed.transpose();
    return absl::OkStatus();
  }

  Eigen::MatrixXd& sum() { return sum_; }

 private:
  // Unobserved directions of an instant carry no information; they must not become infinite.
  static InstantBlock PseudoInverse(const InstantBlock& block) {
    constexpr double kOpen = 1e-10;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(block);
    const double largest = eigen.eigenvalues().maxCoeff();
    Eigen::Matrix<double, kPoseSize, 1> inverse;
    for (int i = 0; i < kPoseSize; ++i) {
      const double value = eigen.eigenvalues()[i];
      inverse[i] = value > kOpen * largest ? 1 / value : 0;
    }
    return eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  }

  // Columns of the whitened residual by the estimated parameters and by the wand's pose (origin,
  // two of the direction; of a rigid target origin and rotation vector).
  absl::Status Linearise(const TrueInstant& instant, const SeenMarker& seen,
                         Eigen::MatrixXd* rig_columns, PoseColumns* wand_columns) {
    const TrueCamera& camera = rig_.cameras[static_cast<size_t>(seen.camera)];
    const bool is_rigid = !rig_.points_m.empty();
    const auto m = static_cast<size_t>(seen.marker);
    const double s = is_rigid ? 0 : rig_.marker_positions_m[m];
    const Eigen::Vector3d& direction = instant.wand.direction;
    const Eigen::Vector3d arm =
        is_rigid ? instant.wand.rotation * rig_.points_m[m] : Eigen::Vector3d(s * direction);
    const Eigen::Vector3d velocity_m_s =
        instant.origin_velocity_m_s + instant.turn_rad_s.cross(arm);
    const Eigen::Vector3d x_in_cam = camera.cam_from_rig * (instant.wand.origin_m + arm);
    if (!(x_in_cam.z() > 0)) {
      return absl::FailedPreconditionError(
          absl::StrCat("marker ", seen.marker, " is behind camera ", seen.camera));
    }
    server::BundleMarker marker;
    marker.sqrt_information = seen.covariance_px2.inverse().llt().matrixU();
    const server::MeasuredMarker<double> measured = server::ToMeasured(marker);
    const IntrinsicsVector intrinsics = ToVector(camera.intrinsics);
    const double point[3] = {x_in_cam.x(), x_in_cam.y(), x_in_cam.z()};
    ProjectedPoint<double> projected;
    ProjectPoint<true, true>(camera.intrinsics.model, intrinsics.data(), point, &projected);
    server::Vec3<double> rows[2];
    server::PointDerivative(measured, projected, &rows[0], &rows[1]);
    const Eigen::Vector3d across = direction.unitOrthogonal();
    const Eigen::Matrix3d rotation = camera.cam_from_rig.rotation.toRotationMatrix();
    for (int i = 0; i < 2; ++i) {
      const Eigen::RowVector3d row(rows[i].x, rows[i].y, rows[i].z);
      const Eigen::RowVector3d rig_row = row * rotation;
      if (is_rigid) {
        wand_columns->row(i) << rig_row, arm.cross(rig_row.transpose()).transpose();
      } else {
        wand_columns->row(i) << rig_row, s * rig_row.dot(across),
            s * rig_row.dot(direction.cross(across)), 0;
      }
      if (const int pose = layout_.PoseIndex(seen.camera); pose >= 0) {
        rig_columns->row(i).segment<3>(pose) = x_in_cam.cross(row.transpose());
        rig_columns->row(i).segment<3>(pose + 3) = -rig_row;
      }
      if (options_.marker_positions && seen.marker > 0) {
        (*rig_columns)(i, layout_.first_marker_position + seen.marker - 1) = rig_row.dot(direction);
      }
      if (options_.time_offsets && seen.camera != rig_.reference_camera) {
        // With a larger offset the camera saw the wand at a later instant.
        (*rig_columns)(i, layout_.TimeOffsetIndex(seen.camera)) = rig_row.dot(velocity_m_s);
      }
    }
    if (options_.line_delays) {
      // As a time offset of the marker's row; later is the same as a larger offset.
      const double row = projected.pixel[1] - camera.middle_row;
      for (int i = 0; i < 2; ++i) {
        const Eigen::RowVector3d in_cam(rows[i].x, rows[i].y, rows[i].z);
        (*rig_columns)(i, layout_.first_line_delay + seen.camera) =
            row * (in_cam * rotation).dot(velocity_m_s);
      }
    }
    if (options_.intrinsics) {
      const int count = static_cast<int>(options_.intrinsics_sigma.size());
      for (int k = 0; k < count; ++k) {
        const int column = layout_.first_intrinsics + count * seen.camera + k;
        server::ViewDerivative<true>(server::ViewUnknowns::kFirstIntrinsic + k, measured, projected,
                                     0.0, 0.0, &(*rig_columns)(0, column),
                                     &(*rig_columns)(1, column));
      }
    }
    return absl::OkStatus();
  }

  const TrueRig& rig_;
  const InformationOptions& options_;
  const RigBound& layout_;
  Eigen::MatrixXd sum_;
};

void AddPriors(const TrueRig& rig, const InformationOptions& options, const RigBound& layout,
               Eigen::MatrixXd* information) {
  if (options.marker_positions) {
    const auto spans = static_cast<Eigen::Index>(rig.marker_positions_m.size()) - 1;
    // Spans are differences of neighbouring positions, the first of which is 0.
    Eigen::MatrixXd differences = Eigen::MatrixXd::Identity(spans, spans);
    for (Eigen::Index i = 1; i < spans; ++i) differences(i, i - 1) = -1;
    information->block(layout.first_marker_position, layout.first_marker_position, spans, spans) +=
        differences.transpose() * differences / (options.span_sigma_m * options.span_sigma_m);
  }
  if (options.intrinsics) {
    const Eigen::VectorXd weights = options.intrinsics_sigma.array().square().inverse();
    for (int c = 0; c < layout.camera_count; ++c) {
      information->diagonal().segment(
          layout.first_intrinsics + static_cast<int>(weights.size()) * c, weights.size()) +=
          weights;
    }
  }
}

}  // namespace

int RigBound::PoseIndex(int camera) const {
  if (camera == reference_camera) return -1;
  return 6 * (camera - (camera > reference_camera ? 1 : 0));
}

int RigBound::TimeOffsetIndex(int camera) const {
  if (camera == reference_camera) return -1;
  return first_time_offset + camera - (camera > reference_camera ? 1 : 0);
}

absl::StatusOr<RigBound> ComputeRigBound(const TrueRig& rig, const InformationOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(RigBound bound, ComputeRigInformation(rig, options));
  RIGCAL_RETURN_IF_ERROR(FillCovariance(&bound));
  return bound;
}

absl::StatusOr<RigBound> ComputeRigInformation(const TrueRig& rig,
                                               const InformationOptions& options) {
  if (!rig.points_m.empty() && options.marker_positions) {
    return absl::InvalidArgumentError("no bound of marker positions of a rigid target");
  }
  RigBound bound;
  bound.reference_camera = rig.reference_camera;
  bound.camera_count = static_cast<int>(rig.cameras.size());
  bound.first_marker_position = 6 * (bound.camera_count - 1);
  const int spans = static_cast<int>(rig.marker_positions_m.size()) - 1;
  bound.first_time_offset = bound.first_marker_position + (options.marker_positions ? spans : 0);
  bound.first_line_delay =
      bound.first_time_offset + (options.time_offsets ? bound.camera_count - 1 : 0);
  bound.first_intrinsics = bound.first_line_delay + (options.line_delays ? bound.camera_count : 0);
  const int intrinsics = options.intrinsics ? static_cast<int>(options.intrinsics_sigma.size()) : 0;
  const Eigen::Index size = bound.first_intrinsics + bound.camera_count * intrinsics;

  InformationSum information(rig, options, bound, size);
  for (const TrueInstant& instant : rig.instants) {
    RIGCAL_RETURN_IF_ERROR(information.Add(instant));
  }
  AddPriors(rig, options, bound, &information.sum());
  bound.information = std::move(information.sum());
  return bound;
}

absl::Status FillCovariance(RigBound* bound) {
  const Eigen::MatrixXd& information = bound->information;
  const Eigen::Index size = information.rows();
  // Parameters of very different units: a factor from a matrix of order one keeps their digits.
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) {
    return absl::FailedPreconditionError("a parameter is in no observation");
  }
  const Eigen::LDLT<Eigen::MatrixXd> factor(scale.asDiagonal() * information * scale.asDiagonal());
  if (factor.info() != Eigen::Success || factor.vectorD().minCoeff() < 1e-12) {
    return absl::FailedPreconditionError("the observations do not determine the rig");
  }
  bound->covariance = scale.asDiagonal() *
                      factor.solve(Eigen::MatrixXd::Identity(size, size)).eval() *
                      scale.asDiagonal();
  return absl::OkStatus();
}

TrueRig GatherStaticInstants(const TrueRig& rig, bool is_surveyed) {
  struct Sum {
    double rows = 0;
    Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
  };
  std::map<std::pair<int, int>, Sum> sums;  // by marker, then camera
  for (const TrueInstant& instant : rig.instants) {
    for (const SeenMarker& seen : instant.markers) {
      Sum& sum = sums[{seen.marker, seen.camera}];
      ++sum.rows;
      sum.covariance_px2 += seen.covariance_px2;
    }
  }
  TrueRig gathered = rig;
  gathered.instants.clear();
  int last_marker = -1;
  for (const auto& [key, sum] : sums) {
    const auto [marker, camera] = key;
    if (gathered.instants.empty() || (!is_surveyed && marker != last_marker)) {
      gathered.instants.emplace_back().wand = rig.instants.front().wand;
    }
    last_marker = marker;
    const double rows = std::min(sum.rows, server::kMaxRowsOfCentre);
    gathered.instants.back().markers.push_back(
        {camera, marker, sum.covariance_px2 / (sum.rows * rows)});
  }
  return gathered;
}

TrueRig MakeTrueRig(const SimulatedWorld& world, int reference) {
  constexpr double kStepS = 1e-4;
  TrueRig rig;
  rig.reference_camera = reference;
  rig.marker_positions_m = world.true_target().marker_positions_m;
  for (const TargetPoint& point : world.true_target().points) {
    rig.points_m.emplace_back(point.x_m, point.y_m, point.z_m);
  }
  const RigidTransform& reference_from_world =
      world.cameras()[static_cast<size_t>(reference)].cam_from_rig;
  int frames = world.FrameCount(0);
  for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
    rig.cameras.push_back(
        {TruePose(world, c, reference), world.cameras()[static_cast<size_t>(c)].true_intrinsics,
         0.5 * (world.cameras()[static_cast<size_t>(c)].description.image_size_px.height - 1)});
    frames = std::min(frames, world.FrameCount(c));
  }
  const auto wand_at = [&](double rig_time_s) {
    const WandPose wand = world.WandAt(rig_time_s);
    return WandPose{reference_from_world * wand.origin_m,
                    reference_from_world.rotation * wand.direction,
                    reference_from_world.rotation * Eigen::Quaterniond(wand.rotation)};
  };
  for (int frame = 0; frame < frames; ++frame) {
    const double rig_time_s = world.FrameRigTime(0, frame);
    TrueInstant instant;
    instant.wand = wand_at(rig_time_s);
    const WandPose before = wand_at(rig_time_s - kStepS), after = wand_at(rig_time_s + kStepS);
    instant.origin_velocity_m_s = (after.origin_m - before.origin_m) / (2 * kStepS);
    // Of a line the turn about itself is open, and moves no marker.
    const Eigen::AngleAxisd turn(Eigen::Quaterniond(after.rotation) *
                                 Eigen::Quaterniond(before.rotation).conjugate());
    instant.turn_rad_s =
        rig.points_m.empty()
            ? instant.wand.direction.cross((after.direction - before.direction) / (2 * kStepS))
            : Eigen::Vector3d(turn.angle() * turn.axis() / (2 * kStepS));
    for (int c = 0; c < static_cast<int>(rig.cameras.size()); ++c) {
      std::vector<bool> is_outlier;
      const Observation row = world.Observe(c, frame, &is_outlier);
      for (size_t m = 0; m < row.markers.size(); ++m) {
        if (!row.markers[m].visible || is_outlier[m]) continue;
        instant.markers.push_back({c, static_cast<int>(m), row.markers[m].covariance_px2});
      }
    }
    rig.instants.push_back(std::move(instant));
  }
  return rig;
}

}  // namespace rigcal::accuracy
