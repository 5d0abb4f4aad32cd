// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_estimate.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

#include "server/solve/bundle/envelope_matrix.h"

namespace rigcal::server {
namespace {

// exp([vector]x)
Eigen::Quaterniond FromRotationVector(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (angle == 0) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, vector / angle));
}

}  // namespace

template <typename Self>
auto* LineBundleEstimate::ValueOf(Self* self, const ReducedParameter& parameter) {
  const auto index = static_cast<size_t>(parameter.index);
  switch (parameter.kind) {
    case ReducedParameterKind::kTranslation:
      return &self->cameras_[index].cam_from_rig.translation_m[parameter.component];
    case ReducedParameterKind::kIntrinsic:
      return &self->cameras_[index].intrinsics[parameter.component];
    case ReducedParameterKind::kTimeOffset:
      return &self->clocks_[index].time_offset_s;
    case ReducedParameterKind::kTimeRate:
      return &self->clocks_[index].time_rate;
    case ReducedParameterKind::kLineDelay:
      return &self->cameras_[index].line_delay_s;
    case ReducedParameterKind::kMarkerPosition:
      return &self->positions_[index];
    case ReducedParameterKind::kTargetPoint:  // of a rigid target, which no line bundle has
    case ReducedParameterKind::kRotation:
      break;
  }
  return decltype(&self->positions_[index])(nullptr);
}

LineBundleEstimate::LineBundleEstimate(const BundleProblem& problem, const LineBundleLayout& layout,
                                       const PackedMarkers& packed)
    : layout_(&layout),
      cameras_(problem.cameras),
      clocks_(problem.clocks),
      positions_(problem.target.marker_positions_m),
      views_(layout.views.size()),
      poses_(static_cast<size_t>(packed.group_count() * kPoseLanes * kGroupSize)) {
  for (BundleCamera& camera : cameras_) camera.cam_from_rig.rotation.normalize();
  for (size_t i = 0; i < poses_.size() / kPoseLanes; ++i) {
    double* const lane = poses_.data() + i / kGroupSize * kPoseLanes * kGroupSize + i % kGroupSize;
    Eigen::Vector3d origin = Eigen::Vector3d::Zero(), direction = Eigen::Vector3d::UnitX();
    if (i < packed.instants.size()) {
      const BundleInstant& instant = problem.instants[static_cast<size_t>(packed.instants[i])];
      origin = instant.origin_m;
      direction = instant.direction.normalized();
    }
    for (int j = 0; j < 3; ++j) {
      lane[j * kGroupSize] = origin[j];
      lane[(3 + j) * kGroupSize] = direction[j];
    }
  }
  RefreshViews();
}

void LineBundleEstimate::RefreshViews() {
  for (size_t v = 0; v < views_.size(); ++v) {
    const BundleCamera& camera = cameras_[static_cast<size_t>(layout_->views[v].camera)];
    const BundleClock& clock = clocks_[static_cast<size_t>(layout_->views[v].clock)];
    ViewEstimate<double>& view = views_[v];
    view.model = camera.model;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(view.rotation) =
        camera.cam_from_rig.rotation.toRotationMatrix();
    Eigen::Map<Eigen::Vector3d>(view.translation) = camera.cam_from_rig.translation_m;
    std::copy_n(camera.intrinsics.data(), camera.intrinsics.size(), view.intrinsics);
    view.offset_s = clock.time_offset_s;
    view.rate = clock.time_rate;
    view.line_delay_s = camera.line_delay_s;
    view.middle_row = camera.middle_row;
  }
}

void LineBundleEstimate::MoveReduced(const LineBundleEstimate& from, const Eigen::VectorXd& step) {
  cameras_ = from.cameras_;
  clocks_ = from.clocks_;
  positions_ = from.positions_;
  for (int column = 0; column < layout_->column_count(); ++column) {
    const ReducedParameter& parameter = layout_->parameters[static_cast<size_t>(column)];
    if (double* const value = ValueOf(this, parameter)) {
      *value += step[column];
    } else if (parameter.component == 0) {
      Eigen::Quaterniond& rotation =
          cameras_[static_cast<size_t>(parameter.index)].cam_from_rig.rotation;
      rotation = (FromRotationVector(step.segment<3>(column)) * rotation).normalized();
    }
  }
  RefreshViews();
}

double LineBundleEstimate::Value(int column) const {
  const double* const value = ValueOf(this, layout_->parameters[static_cast<size_t>(column)]);
  return value == nullptr ? 0 : *value;
}

double LineBundleEstimate::PriorResidual(const ReducedPrior& prior) const {
  const double value = Value(prior.plus) - (prior.minus < 0 ? 0 : Value(prior.minus));
  return (value - prior.mean) * prior.inverse_sigma;
}

double LineBundleEstimate::PriorCost() const {
  double cost = 0;
  for (const ReducedPrior& prior : layout_->priors) {
    const double residual = PriorResidual(prior);
    cost += 0.5 * residual * residual;
  }
  if (layout_->distance) {
    const ReducedDistance& distance = *layout_->distance;
    const double residual = (Difference(distance).norm() - distance.mean) * distance.inverse_sigma;
    cost += 0.5 * residual * residual;
  }
  return cost;
}

Eigen::Vector3d LineBundleEstimate::Difference(const ReducedDistance& distance) const {
  const auto centre = [this](int camera) {
    return cameras_[static_cast<size_t>(camera)].cam_from_rig.SourceFromTargetTranslation();
  };
  return centre(distance.camera_b) - centre(distance.camera_a);
}

template <typename Matrix>
void LineBundleEstimate::AddDistance(const ReducedDistance& distance, Matrix* matrix,
                                     Eigen::VectorXd* gradient) const {
  const Eigen::Vector3d difference = Difference(distance);
  const double length = difference.norm();
  if (!(length > 0)) return;
  const double residual = (length - distance.mean) * distance.inverse_sigma;
  std::vector<std::pair<int, double>> row;  // derivatives of the residual, by column
  for (const bool is_a : {true, false}) {
    const int pose = is_a ? distance.pose_a : distance.pose_b;
    if (pose < 0) continue;
    const RigidTransform& cam_from_rig =
        cameras_[static_cast<size_t>(is_a ? distance.camera_a : distance.camera_b)].cam_from_rig;
    // The centre -R^T t under exp([w]x) R and t + dt moves by -R^T (dt + t x w).
    const Eigen::Vector3d outward =
        (is_a ? -1 : 1) * distance.inverse_sigma / length * (cam_from_rig.rotation * difference);
    const Eigen::Vector3d turn = cam_from_rig.translation_m.cross(outward);
    for (int i = 0; i < 3; ++i) {
      row.emplace_back(pose + i, turn[i]);
      row.emplace_back(pose + 3 + i, -outward[i]);
    }
  }
  for (const auto& [i, d_i] : row) {
    (*gradient)[i] += residual * d_i;
    for (const auto& [j, d_j] : row) {
      if (j <= i) (*matrix)(i, j) += d_i * d_j;
    }
  }
}

template <typename Matrix>
void LineBundleEstimate::AddPriors(Matrix* matrix, Eigen::VectorXd* gradient) const {
  if (layout_->distance) AddDistance(*layout_->distance, matrix, gradient);
  for (const ReducedPrior& prior : layout_->priors) {
    const double residual = PriorResidual(prior);
    const double information = prior.inverse_sigma * prior.inverse_sigma;
    (*gradient)[prior.plus] += residual * prior.inverse_sigma;
    (*matrix)(prior.plus, prior.plus) += information;
    if (prior.minus < 0) continue;
    (*gradient)[prior.minus] -= residual * prior.inverse_sigma;
    (*matrix)(prior.minus, prior.minus) += information;
    (*matrix)(std::max(prior.plus, prior.minus), std::min(prior.plus, prior.minus)) -= information;
  }
}

template void LineBundleEstimate::AddPriors(Eigen::MatrixXd*, Eigen::VectorXd*) const;
template void LineBundleEstimate::AddPriors(EnvelopeMatrix*, Eigen::VectorXd*) const;

double LineBundleEstimate::ReducedNorm2() const {
  double norm2 = 0;
  for (int column = 0; column < layout_->column_count(); ++column) {
    const ReducedParameter& parameter = layout_->parameters[static_cast<size_t>(column)];
    const double value = Value(column);
    norm2 += value * value;
    // A unit quaternion's.
    if (parameter.kind == ReducedParameterKind::kRotation && parameter.component == 0) norm2 += 1;
  }
  return norm2;
}

void LineBundleEstimate::Store(const PackedMarkers& packed, BundleProblem* problem) const {
  for (size_t c = 0; c < cameras_.size(); ++c) {
    problem->cameras[c].cam_from_rig = cameras_[c].cam_from_rig;
    problem->cameras[c].intrinsics = cameras_[c].intrinsics;
    problem->cameras[c].line_delay_s = cameras_[c].line_delay_s;
  }
  for (size_t k = 0; k < clocks_.size(); ++k) {
    problem->clocks[k].time_offset_s = clocks_[k].time_offset_s;
    problem->clocks[k].time_rate = clocks_[k].time_rate;
  }
  problem->target.marker_positions_m = positions_;
  for (size_t i = 0; i < packed.instants.size(); ++i) {
    BundleInstant& instant = problem->instants[static_cast<size_t>(packed.instants[i])];
    const double* const lane =
        poses_.data() + i / kGroupSize * kPoseLanes * kGroupSize + i % kGroupSize;
    for (int j = 0; j < 3; ++j) {
      instant.origin_m[j] = lane[j * kGroupSize];
      instant.direction[j] = lane[(3 + j) * kGroupSize];
    }
  }
}

}  // namespace rigcal::server
