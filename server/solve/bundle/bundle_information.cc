// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/bundle_information.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/line_bundle_layout.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr int kMaxPoseSize = 6;
using PoseBlock = Eigen::Matrix<double, kMaxPoseSize, kMaxPoseSize>;
using PoseVector = Eigen::Matrix<double, kMaxPoseSize, 1>;

// Derivatives of a whitened residual: by columns of the reduced system, and by the instant's pose.
struct MarkerDerivatives {
  std::vector<std::pair<int, Eigen::Vector2d>> reduced;
  Eigen::Matrix<double, 2, kMaxPoseSize> pose;
  Eigen::Vector2d residual;
};

class InformationSum {
 public:
  InformationSum(const BundleOptions& options, const BundleProblem& problem)
      : options_(options), problem_(problem), layout_(LayOut(problem)) {
    AddPointColumns();
    const int size = layout_.column_count();
    matrix_ = Eigen::MatrixXd::Zero(size, size);
    coupling_ = Eigen::MatrixXd::Zero(size, kMaxPoseSize);
    gradient_ = Eigen::VectorXd::Zero(size);
  }

  absl::StatusOr<ReducedInformation> Compute() {
    if (layout_.views.empty()) {
      return absl::FailedPreconditionError("bundle adjustment: no marker is used");
    }
    for (const BundleInstant& instant : problem_.instants) {
      if (instant.used) RIGCAL_RETURN_IF_ERROR(AddInstant(instant));
    }
    AddPriors();
    return ReducedInformation{
        .parameters = layout_.parameters,
        .information = matrix_.selfadjointView<Eigen::Lower>(),
        .gradient = gradient_,
    };
  }

 private:
  // Only of points that somebody sees.
  void AddPointColumns() {
    point_column_.assign(problem_.rigid_target.points_m.size(), -1);
    std::vector<bool> seen(point_column_.size(), false);
    for (const BundleInstant& instant : problem_.instants) {
      if (!instant.is_rigid) continue;
      ForEachUsedMarker(problem_, instant,
                        [&seen](const BundleObservation&, const BundleMarker& marker) {
                          seen[static_cast<size_t>(marker.marker)] = true;
                        });
    }
    for (size_t m = 0; m < seen.size(); ++m) {
      if (!seen[m] || !problem_.rigid_target.IsFree(m)) continue;
      point_column_[m] = layout_.column_count();
      for (int i = 0; i < 3; ++i) {
        const int column = layout_.column_count();
        layout_.parameters.push_back({ReducedParameterKind::kTargetPoint, static_cast<int>(m), i});
        layout_.priors.push_back({column, -1, problem_.rigid_target.given_points_m[m][i],
                                  1 / problem_.rigid_target.sigma_m[m]});
      }
    }
  }

  absl::Status AddInstant(const BundleInstant& instant) {
    const int pose_size = instant.is_point ? 3 : instant.is_rigid ? 6 : 5;
    PoseBlock own;
    own.setZero();
    PoseVector own_gradient = PoseVector::Zero();
    touched_.clear();
    absl::Status status;
    ForEachUsedMarker(
        problem_, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          if (!status.ok()) return;
          double weight = 1;
          if (!Differentiate(instant, observation, marker, &weight)) {
            status = absl::FailedPreconditionError(
                absl::StrCat("bundle adjustment: camera ", problem_.CameraOf(observation).name,
                             " cannot see marker ", marker.marker, ", which it is said to show"));
            return;
          }
          own += weight * marker_.pose.transpose() * marker_.pose;
          own_gradient += weight * marker_.pose.transpose() * marker_.residual;
          for (const auto& [i, d_i] : marker_.reduced) {
            coupling_.row(i) += weight * d_i.transpose() * marker_.pose;
            gradient_[i] += weight * d_i.dot(marker_.residual);
            touched_.push_back(i);
            for (const auto& [j, d_j] : marker_.reduced) {
              if (j <= i) matrix_(i, j) += weight * d_i.dot(d_j);
            }
          }
        });
    RIGCAL_RETURN_IF_ERROR(status);
    std::ranges::sort(touched_);
    touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
    return Eliminate(own, own_gradient, pose_size);
  }

  absl::Status Eliminate(const PoseBlock& own, const PoseVector& own_gradient, int pose_size) {
    if (touched_.empty()) return absl::OkStatus();
    const Eigen::LLT<Eigen::MatrixXd> factor(own.topLeftCorner(pose_size, pose_size));
    if (factor.info() != Eigen::Success) {
      return absl::FailedPreconditionError(
          "bundle adjustment: the markers of an instant do not determine its pose");
    }
    const auto count = static_cast<Eigen::Index>(touched_.size());
    Eigen::MatrixXd rows(pose_size, count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const int column = touched_[static_cast<size_t>(i)];
      rows.col(i) = coupling_.row(column).head(pose_size).transpose();
      coupling_.row(column).setZero();
    }
    factor.matrixL().solveInPlace(rows);
    const Eigen::VectorXd pose_gradient = factor.matrixL().solve(own_gradient.head(pose_size));
    for (Eigen::Index j = 0; j < count; ++j) {
      gradient_[touched_[static_cast<size_t>(j)]] -= rows.col(j).dot(pose_gradient);
      for (Eigen::Index i = j; i < count; ++i) {
        matrix_(touched_[static_cast<size_t>(i)], touched_[static_cast<size_t>(j)]) -=
            rows.col(i).dot(rows.col(j));
      }
    }
    return absl::OkStatus();
  }

  // Into marker_, with the robust loss's weight. False: not visible.
  bool Differentiate(const BundleInstant& instant, const BundleObservation& observation,
                     const BundleMarker& marker, double* weight) {
    const BundleCamera& camera = problem_.CameraOf(observation);
    const Eigen::Vector3d x_in_rig = problem_.PointOf(instant, marker);
    const Eigen::Vector3d rotated = camera.cam_from_rig.rotation * x_in_rig;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> d_point;
    IntrinsicsJacobian d_intrinsics;
    if (!Project(camera.model, camera.intrinsics.data(),
                 rotated + camera.cam_from_rig.translation_m, &pixel, &d_point, &d_intrinsics)) {
      return false;
    }
    const Eigen::Matrix2d root = marker.sqrt_information;
    marker_.residual = root * (pixel - CentreAtInstantPx(problem_, observation, marker));
    if (options_.robust) {
      *weight =
          1 / (1 + marker_.residual.squaredNorm() / (options_.loss_scale * options_.loss_scale));
    }
    d_point = root * d_point;
    const Eigen::Matrix<double, 2, 3> d_rig =
        d_point * camera.cam_from_rig.rotation.toRotationMatrix();
    DifferentiatePose(instant, marker, x_in_rig, d_rig);
    marker_.reduced.clear();
    const KernelColumns& columns =
        layout_
            .columns[static_cast<size_t>(layout_.ViewIndex(observation.camera, observation.clock))];
    if (columns.pose >= 0) {
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i);
        marker_.reduced.emplace_back(columns.pose + i, d_point * axis.cross(rotated));
        marker_.reduced.emplace_back(columns.pose + 3 + i, d_point.col(i));
      }
    }
    const Eigen::Vector2d velocity = root * marker.velocity_px_s;
    for (int b = 0; b < columns.base_count; ++b) {
      const int kind = columns.base_kind[b];
      Eigen::Vector2d derivative;
      if (kind == ViewUnknowns::kOffset) {
        derivative = velocity;
      } else if (kind == ViewUnknowns::kRate) {
        derivative = observation.clock_time_s * velocity;
      } else if (kind == ViewUnknowns::kLineDelay) {
        derivative = (marker.centre_px.y() - camera.middle_row) * velocity;
      } else {
        derivative = root * d_intrinsics.col(kind - ViewUnknowns::kFirstIntrinsic);
      }
      marker_.reduced.emplace_back(columns.base_column[b], derivative);
    }
    DifferentiateTarget(instant, marker, d_rig);
    return true;
  }

  void DifferentiatePose(const BundleInstant& instant, const BundleMarker& marker,
                         const Eigen::Vector3d& x_in_rig,
                         const Eigen::Matrix<double, 2, 3>& d_rig) {
    marker_.pose.leftCols<3>() = d_rig;
    if (instant.is_rigid) {
      const Eigen::Vector3d arm = x_in_rig - instant.origin_m;
      for (int i = 0; i < 3; ++i) {
        marker_.pose.col(3 + i) = d_rig * Eigen::Vector3d::Unit(i).cross(arm);
      }
      return;
    }
    const double s = problem_.target.marker_positions_m[static_cast<size_t>(marker.marker)];
    const Eigen::Vector3d tangent = instant.direction.unitOrthogonal();
    marker_.pose.col(3) = s * d_rig * tangent;
    marker_.pose.col(4) = s * d_rig * instant.direction.cross(tangent);
    marker_.pose.col(5).setZero();
  }

  void DifferentiateTarget(const BundleInstant& instant, const BundleMarker& marker,
                           const Eigen::Matrix<double, 2, 3>& d_rig) {
    if (instant.is_rigid) {
      const int column = point_column_[static_cast<size_t>(marker.marker)];
      if (column < 0) return;
      const Eigen::Matrix<double, 2, 3> d_target = d_rig * instant.rotation.toRotationMatrix();
      for (int i = 0; i < 3; ++i) marker_.reduced.emplace_back(column + i, d_target.col(i));
    } else if (layout_.spacing_column >= 0 && marker.marker > 0) {
      marker_.reduced.emplace_back(layout_.spacing_column + marker.marker - 1,
                                   d_rig * instant.direction);
    }
  }

  void AddPriors() {
    for (const ReducedPrior& prior : layout_.priors) {
      const double information = prior.inverse_sigma * prior.inverse_sigma;
      matrix_(prior.plus, prior.plus) += information;
      if (prior.minus < 0) continue;
      matrix_(prior.minus, prior.minus) += information;
      matrix_(std::max(prior.plus, prior.minus), std::min(prior.plus, prior.minus)) -= information;
    }
    if (!layout_.distance) return;
    const Eigen::VectorXd row = DistanceRow(*layout_.distance);
    matrix_ += row * row.transpose();
  }

  // Derivatives of the distance prior's residual.
  Eigen::VectorXd DistanceRow(const ReducedDistance& distance) const {
    const auto pose = [this](int camera) -> const RigidTransform& {
      return problem_.cameras[static_cast<size_t>(camera)].cam_from_rig;
    };
    const Eigen::Vector3d direction = (pose(distance.camera_b).SourceFromTargetTranslation() -
                                       pose(distance.camera_a).SourceFromTargetTranslation())
                                          .normalized();
    Eigen::VectorXd row = Eigen::VectorXd::Zero(matrix_.rows());
    for (const bool is_a : {true, false}) {
      const int column = is_a ? distance.pose_a : distance.pose_b;
      if (column < 0) continue;
      const RigidTransform& cam_from_rig = pose(is_a ? distance.camera_a : distance.camera_b);
      // The centre -R^T t under exp([w]x) R and t + dt moves by -R^T (dt + t x w).
      const Eigen::Vector3d outward =
          (is_a ? -1 : 1) * distance.inverse_sigma * (cam_from_rig.rotation * direction);
      row.segment<3>(column) += cam_from_rig.translation_m.cross(outward);
      row.segment<3>(column + 3) -= outward;
    }
    return row;
  }

  const BundleOptions& options_;
  const BundleProblem& problem_;
  LineBundleLayout layout_;
  std::vector<int> point_column_;  // by point of the rigid target, -1: none
  Eigen::MatrixXd matrix_;         // lower triangle
  Eigen::VectorXd gradient_;       // without that of the priors
  Eigen::MatrixXd coupling_;       // of an instant's pose, by column; zero in between
  std::vector<int> touched_;       // columns of an instant
  MarkerDerivatives marker_;
};

}  // namespace

absl::StatusOr<ReducedInformation> ComputeGeneralInformation(const BundleOptions& options,
                                                             const BundleProblem& problem) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(problem.Validate());
  return InformationSum(options, problem).Compute();
}

}  // namespace rigcal::server
