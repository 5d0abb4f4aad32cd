// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/scale_uncertainty.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "common/geometry/rigid_transform.h"

namespace rigcal::server {
namespace {

// Derivatives of the distance that gives the scale, by row.
Eigen::VectorXd DistanceGradient(const BundleProblem& problem, const RigUncertainty& rig) {
  const BundleDistance& distance = *problem.distance;
  const RigidTransform& a = problem.cameras[static_cast<size_t>(distance.camera_a)].cam_from_rig;
  const RigidTransform& b = problem.cameras[static_cast<size_t>(distance.camera_b)].cam_from_rig;
  const Eigen::Vector3d direction =
      (b.SourceFromTargetTranslation() - a.SourceFromTargetTranslation()).normalized();
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(rig.covariance.rows());
  for (const bool is_a : {true, false}) {
    const int camera = is_a ? distance.camera_a : distance.camera_b;
    const RigidTransform& pose = is_a ? a : b;
    const Eigen::Vector3d outward = pose.rotation * Eigen::Vector3d(is_a ? -direction : direction);
    const Eigen::Vector3d turn = pose.translation_m.cross(outward);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Index w = rig.Row({ReducedParameterKind::kRotation, camera, i});
      const Eigen::Index d = rig.Row({ReducedParameterKind::kTranslation, camera, i});
      if (w >= 0) gradient[w] = turn[i];
      if (d >= 0) gradient[d] = -outward[i];
    }
  }
  return gradient;
}

// The solver's hold on the distance is not what is known of it: that is `sigma_m`, 0 for a unit.
void DescribeDistanceScale(const BundleProblem& problem, double sigma_m, RigUncertainty* rig) {
  const Eigen::VectorXd gradient = DistanceGradient(problem, *rig);
  const Eigen::VectorXd column = rig->covariance * gradient;
  const double variance = gradient.dot(column);
  rig->shape_covariance = rig->covariance - column * column.transpose() / variance;
  const double share = sigma_m / variance;
  rig->covariance = rig->shape_covariance + share * share * column * column.transpose();
  rig->scale_sigma_rel = sigma_m / problem.distance->distance_m;
}

// A scale as the target's own lengths have it: its error is `gradient` times the parameters'
// errors, and that of lengths that were not estimated.
struct TargetScale {
  Eigen::VectorXd gradient;
  double given_variance = 0;

  double Variance(const RigUncertainty& rig) const {
    return gradient.dot(rig.covariance * gradient) + given_variance;
  }
};

// The scale of a set of points is its size about the centroid: with p_m from there,
// scale - 1 = sum p_m . d_m / sum |p_m|^2 for displacements d_m of the points; of several parts,
// each about its own. None: every part is one point.
std::optional<TargetScale> RigidScale(const BundleProblem& problem, const RigUncertainty& rig) {
  const BundleRigidTarget& target = problem.rigid_target;
  std::vector<Eigen::Vector3d> from_middle;
  double size = 0;
  for (const auto& [first, last] : target.Parts()) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    const auto begin = target.points_m.begin() + first, end = target.points_m.begin() + last;
    for (auto point = begin; point != end; ++point) middle += *point / (last - first);
    for (auto point = begin; point != end; ++point) {
      from_middle.push_back(*point - middle);
      size += from_middle.back().squaredNorm();
    }
  }
  if (!(size > 0)) return std::nullopt;
  TargetScale scale{Eigen::VectorXd::Zero(rig.covariance.rows())};
  for (size_t m = 0; m < from_middle.size(); ++m) {
    for (int i = 0; i < 3; ++i) {
      const double slope = from_middle[m][i] / size;
      const Eigen::Index row =
          rig.Row({ReducedParameterKind::kTargetPoint, static_cast<int>(m), i});
      if (row >= 0) {
        scale.gradient[row] = slope;
      } else if (!target.sigma_m.empty()) {
        scale.given_variance += std::pow(slope * target.sigma_m[m], 2);
      }
    }
  }
  return scale;
}

// Of one wand.
TargetScale WandScale(const BundleTarget& target, const BundleWand& wand,
                      const RigUncertainty& rig) {
  const double length_m = target.marker_positions_m[static_cast<size_t>(wand.end) - 1];
  TargetScale scale{Eigen::VectorXd::Zero(rig.covariance.rows())};
  const Eigen::Index row = rig.Row({ReducedParameterKind::kMarkerPosition, wand.end - 1, 0});
  if (row >= 0) {
    scale.gradient[row] = 1 / length_m;
  } else {
    // Not estimated: the tolerance of the spans is all that is known.
    scale.given_variance = (wand.end - wand.first - 1) * std::pow(wand.span_sigma_m / length_m, 2);
  }
  return scale;
}

// Of every target that has lengths.
std::vector<TargetScale> ScalesOf(const BundleProblem& problem, const RigUncertainty& rig) {
  std::vector<TargetScale> scales;
  if (auto rigid = RigidScale(problem, rig)) scales.push_back(*std::move(rigid));
  for (const BundleWand& wand : problem.target.Wands()) {
    if (wand.end - wand.first > 1) scales.push_back(WandScale(problem.target, wand, rig));
  }
  return scales;
}

void DescribeTargetScale(const BundleProblem& problem, RigUncertainty* rig) {
  rig->shape_covariance = rig->covariance;
  // Those that are estimated agree; of others the one that is known best counts.
  const std::vector<TargetScale> scales = ScalesOf(problem, *rig);
  const auto scale = std::ranges::min_element(
      scales, {}, [rig](const TargetScale& one) { return one.Variance(*rig); });
  if (scale == scales.end()) return;
  rig->scale_sigma_rel = std::sqrt(scale->Variance(*rig));
  const Eigen::VectorXd column = rig->covariance * scale->gradient;
  const double variance = scale->gradient.dot(column);
  if (variance > 0) rig->shape_covariance -= column * column.transpose() / variance;
}

}  // namespace

void DescribeScale(const BundleProblem& problem, double distance_sigma_m,
                   RigUncertainty* uncertainty) {
  if (problem.distance) {
    DescribeDistanceScale(problem, distance_sigma_m, uncertainty);
  } else {
    DescribeTargetScale(problem, uncertainty);
  }
}

}  // namespace rigcal::server
