// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/kept_lenses.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>

#include "server/solve/bundle/line_bundle.h"
#include "server/solve/evaluate/loss_factors.h"
#include "server/solve/evaluate/scale_uncertainty.h"
#include "server/solve/rig/intrinsics_prior.h"

namespace rigcal::server {
namespace {

// Share of a direction's variance that the prior alone would leave; above it the data say nothing.
constexpr double kUntoldShare = 0.999;
// Of the common variance, tried in steps of a tenth; the priors are wide.
constexpr double kLeastVariance = 1e-9, kMostVariance = 10;
constexpr double kStep = 1.1;
// Intrinsics of so many are first looked at camera by camera: to take them apart together takes the
// cube of their number.
constexpr Eigen::Index kManyParameters = 256;
// Of a camera with its clock, for how many numbers a solve has estimated.
constexpr size_t kPoseParameters = 7;

// One direction of the intrinsics, in sigmas of the priors.
struct Direction {
  double estimate = 0;   // by the data alone, from the given ones
  double precision = 0;  // of it
};

// 5 % of exact lenses: 2.706 is the 90 % quantile of a chi-square of one degree of freedom.
constexpr double kByChance = 0.5 * 2.706;

double LogLikelihood(const std::vector<Direction>& directions, double variance) {
  double sum = 0;
  for (const Direction& direction : directions) {
    const double all = variance + 1 / direction.precision;
    sum -= 0.5 * (std::log(all) + direction.estimate * direction.estimate / all);
  }
  return sum;
}

// Directions of the intrinsics in these rows of the covariance; none where it cannot be taken
// apart.
struct Directions {
  Eigen::MatrixXd axes;         // orthogonal, in sigmas of the priors
  std::vector<Direction> seen;  // by axis; nothing of those that the data say nothing of
  std::vector<Direction> told;  // the others
};

std::optional<Directions> TakeApart(const Eigen::MatrixXd& covariance,
                                    const Eigen::VectorXd& difference, double design_effect) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  if (eigen.info() != Eigen::Success) return std::nullopt;
  Directions directions{eigen.eigenvectors(), {}, {}};
  directions.seen.resize(static_cast<size_t>(difference.size()));
  const Eigen::VectorXd along = directions.axes.transpose() * difference;
  for (Eigen::Index i = 0; i < difference.size(); ++i) {
    const double share = eigen.eigenvalues()[i];
    if (!(share > 0) || share > kUntoldShare) continue;
    Direction& own = directions.seen[static_cast<size_t>(i)];
    own = {along[i] / (1 - share), (1 / share - 1) / std::max(1.0, design_effect)};
    directions.told.push_back(own);
  }
  return directions;
}

// 0 where none is as likely as chance allows: by the ratio of the likelihoods, which at a bound of
// the parameter is half a chi-square (Self and Liang, Journal of the American Statistical
// Association 82, 1987).
double LikeliestVariance(const std::vector<Direction>& directions) {
  double best = 0, highest = LogLikelihood(directions, 0) + kByChance;
  for (double variance = kLeastVariance; variance < kMostVariance; variance *= kStep) {
    const double likelihood = LogLikelihood(directions, variance);
    if (likelihood > highest) {
      highest = likelihood;
      best = variance;
    }
  }
  return best;
}

// The intrinsics that were refined and that the other solution keeps.
struct KeptParameter {
  Eigen::Index row = 0;
  double difference = 0;  // from the given value, in sigmas of the prior
  double sigma = 0;       // of the prior
};

std::vector<KeptParameter> KeptParameters(const std::vector<BundleCamera>& kept,
                                          const std::vector<BundleCamera>& refined,
                                          const std::vector<ReducedParameter>& parameters) {
  std::vector<KeptParameter> found;
  for (size_t i = 0; i < parameters.size(); ++i) {
    const ReducedParameter& parameter = parameters[i];
    if (parameter.kind != ReducedParameterKind::kIntrinsic) continue;
    const auto c = static_cast<size_t>(parameter.index);
    if (!kept[c].intrinsics_fixed) continue;
    const BundleCamera& camera = refined[c];
    const double sigma = camera.intrinsics_sigma[parameter.component];
    if (!(sigma > 0)) continue;
    found.push_back(
        {static_cast<Eigen::Index>(i),
         (camera.intrinsics[parameter.component] - camera.intrinsics_mean[parameter.component]) /
             sigma,
         sigma});
  }
  return found;
}

Eigen::Index PlaceIn(const std::vector<ReducedParameter>& list, const ReducedParameter& parameter) {
  const auto found = std::ranges::find(list, parameter);
  return found == list.end() ? -1 : found - list.begin();
}

// In the rows of a longer list of parameters.
Eigen::MatrixXd InRows(const Eigen::MatrixXd& covariance, const std::vector<Eigen::Index>& rows,
                       Eigen::Index size) {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(size, size);
  all(rows, rows) = covariance;
  return all;
}

// In a large rig: whether lenses differ from the given ones by more than chance when each camera's
// intrinsics are looked at by themselves, as if what the cameras say of them were independent.
// `covariance(row, column)`: of rows of one camera.
template <typename Covariance>
bool DifferByCamera(const std::vector<KeptParameter>& parameters,
                    const std::vector<ReducedParameter>& rows, const Covariance& covariance,
                    double design_effect) {
  std::vector<Direction> told;
  for (size_t begin = 0, end = 0; begin < parameters.size(); begin = end) {
    const auto camera_of = [&](size_t i) {
      return rows[static_cast<size_t>(parameters[i].row)].index;
    };
    while (end < parameters.size() && camera_of(end) == camera_of(begin)) ++end;
    const auto count = static_cast<Eigen::Index>(end - begin);
    Eigen::MatrixXd own(count, count);
    Eigen::VectorXd difference(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const KeptParameter& a = parameters[begin + static_cast<size_t>(i)];
      difference[i] = a.difference;
      for (Eigen::Index j = 0; j < count; ++j) {
        const KeptParameter& b = parameters[begin + static_cast<size_t>(j)];
        own(i, j) = covariance(a.row, b.row) / (a.sigma * b.sigma);
      }
    }
    const auto directions = TakeApart(own, difference, design_effect);
    if (directions) {
      told.insert(told.end(), directions->told.begin(), directions->told.end());
    }
  }
  return LikeliestVariance(told) > 0;
}

}  // namespace

KeptLenses MeasureKeptLenses(const std::vector<BundleCamera>& kept, const BundleProblem& refined,
                             const RigUncertainty& uncertainty, double design_effect) {
  KeptLenses lenses;
  const std::vector<KeptParameter> own =
      KeptParameters(kept, refined.cameras, uncertainty.parameters);
  const auto size = static_cast<Eigen::Index>(own.size());
  if (size == 0) return lenses;
  std::vector<Eigen::Index> rows;
  Eigen::VectorXd difference(size), sigma(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const KeptParameter& parameter = own[static_cast<size_t>(i)];
    rows.push_back(parameter.row);
    difference[i] = parameter.difference;
    sigma[i] = parameter.sigma;
  }
  const Eigen::MatrixXd& covariance = uncertainty.noise_covariance;
  if (size > kManyParameters &&
      !DifferByCamera(own, uncertainty.parameters, covariance, design_effect)) {
    return lenses;
  }
  const Eigen::VectorXd unit = sigma.cwiseInverse();
  const auto directions = TakeApart(unit.asDiagonal() * covariance(rows, rows) * unit.asDiagonal(),
                                    difference, design_effect);
  if (!directions) return lenses;
  const double variance = LikeliestVariance(directions->told);
  if (!(variance > 0)) return lenses;
  // Mean and variance of the errors along each direction.
  Eigen::VectorXd mean(size), left(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const Direction& direction = directions->seen[static_cast<size_t>(i)];
    left[i] = 1 / (direction.precision + 1 / variance);
    mean[i] = left[i] * direction.precision * direction.estimate;
  }
  const Eigen::MatrixXd axes = sigma.asDiagonal() * directions->axes;
  // How everything follows the intrinsics, at the length that gives the scale.
  RigUncertainty noise;
  noise.parameters = uncertainty.parameters;
  noise.covariance = covariance;
  DescribeScale(refined, 0, &noise);
  const Eigen::MatrixXd inverse_axes = directions->axes.transpose() * unit.asDiagonal();
  const Eigen::MatrixXd own_along =
      inverse_axes * noise.shape_covariance(rows, rows) * inverse_axes.transpose();
  const Eigen::MatrixXd all_along =
      noise.shape_covariance(Eigen::all, rows) * inverse_axes.transpose();
  const Eigen::LDLT<Eigen::MatrixXd> factor(own_along);
  Eigen::MatrixXd follow = factor.solve(all_along.transpose()).transpose();
  follow(rows, Eigen::all) = axes;
  if (!follow.allFinite()) return lenses;
  lenses.spread = std::sqrt(variance);
  lenses.parameters = uncertainty.parameters;
  const Eigen::VectorXd moved = follow * mean;
  lenses.moment = follow * left.asDiagonal() * follow.transpose();
  lenses.moment.noalias() += moved * moved.transpose();
  return lenses;
}

bool LensesMayDiffer(const RigObservations& rig, const RigSolution& solution,
                     const RigSolveOptions& options, double design_effect) {
  BundleProblem problem = solution.built.problem;
  const BundleOptions bundle;
  const LossFactors loss =
      MeasureLossFactors(solution.built, bundle.loss_scale,
                         static_cast<Eigen::Index>(kPoseParameters * problem.cameras.size()));
  // The data count less by the variance of their errors, priors as given: all of it times that
  // variance is the data's information and the priors' by smaller sigmas.
  const double shorter = 1 / std::sqrt(loss.variance);
  std::vector<BundleCamera> kept = problem.cameras;
  for (size_t c = 0; c < kept.size(); ++c) {
    const bool keeps = c < options.keep_intrinsics.size() && options.keep_intrinsics[c];
    if (!kept[c].intrinsics_fixed || keeps) continue;
    SetIntrinsicsPrior(rig.index.cameras[c], &problem.cameras[c]);
    problem.cameras[c].intrinsics_sigma *= shorter;
  }
  for (BundleClock& clock : problem.clocks) {
    clock.offset_sigma_s *= shorter;
    clock.rate_sigma *= shorter;
  }
  problem.target.span_sigma_m *= shorter;
  const absl::StatusOr<ReducedStep> step = ComputeReducedStep(bundle, problem);
  if (!step.ok()) return true;
  for (BundleCamera& camera : problem.cameras) {
    if (!camera.intrinsics_fixed) camera.intrinsics_sigma /= shorter;
  }
  for (size_t i = 0; i < step->parameters.size(); ++i) {
    const ReducedParameter& parameter = step->parameters[i];
    if (parameter.kind != ReducedParameterKind::kIntrinsic) continue;
    problem.cameras[static_cast<size_t>(parameter.index)].intrinsics[parameter.component] +=
        step->step[static_cast<Eigen::Index>(i)];
  }
  const auto covariance = [&](Eigen::Index row, Eigen::Index column) {
    return loss.variance * step->covariance(std::max(row, column), std::min(row, column));
  };
  return DifferByCamera(KeptParameters(kept, problem.cameras, step->parameters), step->parameters,
                        covariance, design_effect);
}

RigUncertainty WithKeptLenses(const RigUncertainty& uncertainty, const KeptLenses& lenses) {
  RigUncertainty all = uncertainty;
  if (!(lenses.spread > 0)) return all;
  std::vector<Eigen::Index> own, of_lenses;
  for (const ReducedParameter& parameter : lenses.parameters) {
    if (PlaceIn(all.parameters, parameter) < 0) all.parameters.push_back(parameter);
  }
  for (const ReducedParameter& parameter : uncertainty.parameters) {
    own.push_back(PlaceIn(all.parameters, parameter));
  }
  for (const ReducedParameter& parameter : lenses.parameters) {
    of_lenses.push_back(PlaceIn(all.parameters, parameter));
  }
  const auto size = static_cast<Eigen::Index>(all.parameters.size());
  const Eigen::MatrixXd moment = InRows(lenses.moment, of_lenses, size);
  all.covariance = InRows(uncertainty.covariance, own, size) + moment;
  all.shape_covariance = InRows(uncertainty.shape_covariance, own, size) + moment;
  return all;
}

}  // namespace rigcal::server
