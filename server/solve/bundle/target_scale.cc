// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/target_scale.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace rigcal::server {
namespace {

// Of the fixed cameras' centres, as a share of the distance to the rig's origin or of a metre.
constexpr double kOnePlace = 1e-12;
// Singular values below this share of the first one are those of points on a line.
constexpr double kFlat = 1e-9;

// A length of the shape, and what the priors know of it.
struct ScaleTerm {
  double length_m = 0, given_m = 0, variance_m2 = 1;
};

// By marker: an observation that counts shows it.
struct SeenMarkers {
  std::vector<bool> line, rigid;
};

SeenMarkers FindSeen(const BundleProblem& problem) {
  SeenMarkers seen{std::vector<bool>(problem.target.marker_positions_m.size(), false),
                   std::vector<bool>(problem.rigid_target.points_m.size(), false)};
  for (const BundleInstant& instant : problem.instants) {
    std::vector<bool>& own = instant.is_rigid ? seen.rigid : seen.line;
    ForEachUsedMarker(problem, instant,
                      [&own](const BundleObservation&, const BundleMarker& marker) {
                        own[static_cast<size_t>(marker.marker)] = true;
                      });
  }
  return seen;
}

// A marker of what an instant shows, used if any is; -1: it shows none.
int ShownMarker(const BundleProblem& problem, const BundleInstant& instant) {
  int shown = -1;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (marker.used) return marker.marker;
      shown = marker.marker;
    }
  }
  return shown;
}

// The markers of a wand that are seen.
struct WandShape {
  BundleWand wand;
  std::vector<size_t> seen;
};

// Of all that have lengths.
std::vector<WandShape> WandShapes(const BundleTarget& target, const SeenMarkers& seen) {
  std::vector<WandShape> shapes;
  for (const BundleWand& wand : target.Wands()) {
    WandShape shape{wand, {}};
    for (auto m = static_cast<size_t>(wand.first); m < static_cast<size_t>(wand.end); ++m) {
      if (seen.line[m]) shape.seen.push_back(m);
    }
    if (wand.end - wand.first > 1) shapes.push_back(std::move(shape));
  }
  return shapes;
}

void AddTerms(const BundleTarget& target, const WandShape& shape, std::vector<ScaleTerm>* terms) {
  for (size_t i = 1; i < shape.seen.size(); ++i) {
    const size_t a = shape.seen[i - 1], b = shape.seen[i];
    terms->push_back({target.marker_positions_m[b] - target.marker_positions_m[a],
                      target.given_positions_m[b] - target.given_positions_m[a],
                      static_cast<double>(b - a) * std::pow(shape.wand.span_sigma_m, 2)});
  }
}

// A part of the rigid target, and how it is turned and shifted onto what is given of it:
// rotation * (point - middle_m) + given_middle_m.
struct PartShape {
  int first = 0, end = 0;
  std::vector<size_t> seen;
  size_t fixed_count = 0;
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero(), given_middle_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();

  bool Has(int marker) const { return marker >= first && marker < end; }
};

PartShape ShapeOf(const BundleRigidTarget& target, std::pair<int, int> part,
                  const SeenMarkers& seen) {
  PartShape shape;
  shape.first = part.first;
  shape.end = part.second;
  double total = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), given_sum = sum, fixed_m = sum;
  for (auto m = static_cast<size_t>(part.first); m < static_cast<size_t>(part.second); ++m) {
    if (!seen.rigid[m]) continue;
    shape.seen.push_back(m);
    if (!target.IsFree(m)) {
      ++shape.fixed_count;
      fixed_m = target.points_m[m];
      continue;
    }
    const double weight = std::pow(target.sigma_m[m], -2);
    total += weight;
    sum += weight * target.points_m[m];
    given_sum += weight * target.given_points_m[m];
  }
  if (shape.fixed_count > 0) {
    shape.middle_m = shape.given_middle_m = fixed_m;
  } else if (total > 0) {
    shape.middle_m = sum / total;
    shape.given_middle_m = given_sum / total;
  }
  Eigen::Matrix3d product = Eigen::Matrix3d::Zero();
  for (const size_t m : shape.seen) {
    if (!target.IsFree(m)) continue;
    product += std::pow(target.sigma_m[m], -2) * (target.given_points_m[m] - shape.given_middle_m) *
               (target.points_m[m] - shape.middle_m).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(product, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d values = svd.singularValues();
  if (!(values[0] > 0)) return shape;
  if (values[1] <= kFlat * values[0]) {
    // On a line: the least turn.
    shape.rotation = Eigen::Quaterniond::FromTwoVectors(svd.matrixV().col(0), svd.matrixU().col(0));
    return shape;
  }
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs[2] = -1;
  shape.rotation = Eigen::Quaterniond(
      Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose()));
  shape.rotation.normalize();
  return shape;
}

void AddTerms(const BundleRigidTarget& target, const PartShape& shape,
              std::vector<ScaleTerm>* terms) {
  for (const size_t m : shape.seen) {
    if (!target.IsFree(m)) continue;
    const Eigen::Vector3d from_middle_m =
        shape.rotation * Eigen::Vector3d(target.points_m[m] - shape.middle_m);
    const Eigen::Vector3d given_m = target.given_points_m[m] - shape.given_middle_m;
    for (int i = 0; i < 3; ++i) {
      terms->push_back({from_middle_m[i], given_m[i], std::pow(target.sigma_m[m], 2)});
    }
  }
}

double LengthM(const BundleProblem& problem, const BundleDistance& distance) {
  const auto centre = [&problem](int camera) {
    return problem.cameras[static_cast<size_t>(camera)].cam_from_rig.SourceFromTargetTranslation();
  };
  return (centre(distance.camera_b) - centre(distance.camera_a)).norm();
}

double PriorCost(const BundleProblem& problem) {
  double cost = 0;
  const auto add = [&cost](double difference_m, double sigma_m) {
    cost += 0.5 * std::pow(difference_m / sigma_m, 2);
  };
  const BundleTarget& target = problem.target;
  for (const BundleWand& wand : target.Wands()) {
    for (auto m = static_cast<size_t>(wand.first) + 1;
         !target.fixed && m < static_cast<size_t>(wand.end); ++m) {
      add(target.marker_positions_m[m] - target.marker_positions_m[m - 1] -
              (target.given_positions_m[m] - target.given_positions_m[m - 1]),
          wand.span_sigma_m);
    }
  }
  const BundleRigidTarget& rigid = problem.rigid_target;
  for (size_t m = 0; m < rigid.points_m.size(); ++m) {
    if (rigid.IsFree(m))
      add((rigid.points_m[m] - rigid.given_points_m[m]).norm(), rigid.sigma_m[m]);
  }
  if (problem.distance) {
    add(LengthM(problem, *problem.distance) - problem.distance->distance_m,
        problem.distance->sigma_m);
  }
  return cost;
}

// What is unseen between two markers, or before the first one, shares what they are longer than
// given; what is unseen behind the last one is there as given.
void ScaleWand(const WandShape& shape, double factor, BundleTarget* target) {
  const std::vector<double>& given_m = target->given_positions_m;
  std::vector<double>& position_m = target->marker_positions_m;
  auto a = static_cast<size_t>(shape.wand.first);
  for (const size_t b : shape.seen) {
    if (b == a) continue;
    position_m[b] *= factor;
    const double longer_m = position_m[b] - position_m[a] - (given_m[b] - given_m[a]);
    for (size_t m = a + 1; m < b; ++m) {
      position_m[m] = position_m[a] + given_m[m] - given_m[a] +
                      longer_m * static_cast<double>(m - a) / static_cast<double>(b - a);
    }
    a = b;
  }
  for (size_t m = a + 1; m < static_cast<size_t>(shape.wand.end); ++m) {
    position_m[m] = position_m[a] + given_m[m] - given_m[a];
  }
}

void ScalePoints(const PartShape& shape, double factor, BundleRigidTarget* target) {
  for (const size_t m : shape.seen) {
    if (!target->IsFree(m)) continue;
    Eigen::Vector3d& point = target->points_m[m];
    point =
        factor * (shape.rotation * Eigen::Vector3d(point - shape.middle_m)) + shape.given_middle_m;
  }
}

void ScaleCameras(double factor, const Eigen::Vector3d& centre_m, BundleProblem* problem) {
  for (BundleCamera& camera : problem->cameras) {
    if (camera.pose_fixed) continue;
    RigidTransform& pose = camera.cam_from_rig;
    pose.translation_m = factor * pose.translation_m - (1 - factor) * (pose.rotation * centre_m);
  }
}

void ScaleRigid(double factor, const Eigen::Vector3d& centre_m, const PartShape& shape,
                BundleInstant* instant) {
  const Eigen::Quaterniond before(instant->rotation);
  const Eigen::Quaterniond after = (before * shape.rotation.conjugate()).normalized();
  instant->origin_m = centre_m + factor * (instant->origin_m + before * shape.middle_m - centre_m) -
                      after * shape.given_middle_m;
  instant->rotation = after;
}

// Every shape that the priors know a length of; none: the scale is not free.
struct Shapes {
  std::vector<WandShape> wands;
  std::vector<PartShape> parts;
  std::vector<ScaleTerm> terms;
};

std::optional<Shapes> FreeShapes(const BundleProblem& problem) {
  const SeenMarkers seen = FindSeen(problem);
  Shapes shapes;
  shapes.wands = WandShapes(problem.target, seen);
  if (problem.target.fixed && !shapes.wands.empty()) return std::nullopt;
  for (const WandShape& wand : shapes.wands) {
    if (problem.target.marker_positions_m[static_cast<size_t>(wand.wand.first)] != 0) {
      return std::nullopt;
    }
    AddTerms(problem.target, wand, &shapes.terms);
  }
  for (const auto& part : problem.rigid_target.Parts()) {
    if (part.first == part.second) continue;
    shapes.parts.push_back(ShapeOf(problem.rigid_target, part, seen));
    if (shapes.parts.back().fixed_count > 1) return std::nullopt;
    AddTerms(problem.rigid_target, shapes.parts.back(), &shapes.terms);
  }
  if (problem.distance) {
    const BundleDistance& distance = *problem.distance;
    shapes.terms.push_back(
        {LengthM(problem, distance), distance.distance_m, distance.sigma_m * distance.sigma_m});
  }
  return shapes;
}

// In the unit of the first sigma: one for all costs no rounding.
double BestFactor(const std::vector<ScaleTerm>& terms) {
  double product = 0, square = 0;
  for (const ScaleTerm& term : terms) {
    const double weight = terms.front().variance_m2 / term.variance_m2;
    product += weight * term.length_m * term.given_m;
    square += weight * term.length_m * term.length_m;
  }
  return product / square;
}

}  // namespace

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

SettledScale SettleScale(BundleProblem* problem) {
  const std::optional<Eigen::Vector3d> centre = FixedCentre(*problem);
  const std::optional<Shapes> shapes = FreeShapes(*problem);
  if (!centre || !shapes) return {};
  const double factor = BestFactor(shapes->terms);
  if (!(factor > 0) || !std::isfinite(factor)) return {};
  const double cost = PriorCost(*problem);
  ScaleCameras(factor, *centre, problem);
  for (const WandShape& wand : shapes->wands) ScaleWand(wand, factor, &problem->target);
  for (const PartShape& part : shapes->parts) ScalePoints(part, factor, &problem->rigid_target);
  for (BundleInstant& instant : problem->instants) {
    const int marker = instant.is_rigid ? ShownMarker(*problem, instant) : -1;
    const auto part = std::ranges::find_if(
        shapes->parts, [marker](const PartShape& own) { return own.Has(marker); });
    if (part != shapes->parts.end()) {
      ScaleRigid(factor, *centre, *part, &instant);
    } else {
      instant.origin_m = *centre + factor * (instant.origin_m - *centre);
    }
  }
  return {factor, *centre, cost - PriorCost(*problem)};
}

}  // namespace rigcal::server
