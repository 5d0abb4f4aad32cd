// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/target_scale.h"

#include <cmath>
#include <optional>

namespace rigcal::server {
namespace {

// Of the fixed cameras' centres, as a share of the distance to the rig's origin or of a metre.
constexpr double kOnePlace = 1e-12;

// Where the fixed cameras are; none where that is not one place.
std::optional<Eigen::Vector3d> FixedCentre(const BundleProblem& problem) {
  std::optional<Eigen::Vector3d> centre;
  for (const BundleCamera& camera : problem.cameras) {
    if (!camera.pose_fixed) continue;
    const Eigen::Vector3d own = camera.cam_from_rig.SourceFromTargetTranslation();
    if (centre && !((own - *centre).norm() <= kOnePlace * (1 + centre->norm()))) {
      return std::nullopt;
    }
    if (!centre) centre = own;
  }
  return centre;
}

double SpansCost(const BundleTarget& target, double scale) {
  double cost = 0;
  for (size_t m = 1; m < target.marker_positions_m.size(); ++m) {
    const double span_m = target.marker_positions_m[m] - target.marker_positions_m[m - 1];
    const double given_m = target.given_positions_m[m] - target.given_positions_m[m - 1];
    const double sigmas = (scale * span_m - given_m) / target.span_sigma_m;
    cost += 0.5 * sigmas * sigmas;
  }
  return cost;
}

// The factor for every length.
double BestScale(const BundleTarget& target) {
  double product = 0, square = 0;
  for (size_t m = 1; m < target.marker_positions_m.size(); ++m) {
    const double span_m = target.marker_positions_m[m] - target.marker_positions_m[m - 1];
    product += span_m * (target.given_positions_m[m] - target.given_positions_m[m - 1]);
    square += span_m * span_m;
  }
  return product / square;
}

}  // namespace

double SettleScale(BundleProblem* problem) {
  BundleTarget& target = problem->target;
  if (target.fixed || problem->distance || target.marker_positions_m.size() < 2 ||
      target.marker_positions_m.front() != 0) {
    return 0;
  }
  const std::optional<Eigen::Vector3d> centre = FixedCentre(*problem);
  const double scale = BestScale(target);
  if (!centre || !(scale > 0) || !std::isfinite(scale)) return 0;
  const double gain = SpansCost(target, 1) - SpansCost(target, scale);
  if (!(gain > 0)) return 0;
  for (double& position_m : target.marker_positions_m) position_m *= scale;
  for (BundleCamera& camera : problem->cameras) {
    if (camera.pose_fixed) continue;
    RigidTransform& pose = camera.cam_from_rig;
    pose.translation_m = scale * pose.translation_m - (1 - scale) * (pose.rotation * *centre);
  }
  for (BundleInstant& instant : problem->instants) {
    instant.origin_m = *centre + scale * (instant.origin_m - *centre);
  }
  return gain;
}

}  // namespace rigcal::server
