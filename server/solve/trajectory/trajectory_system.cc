// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/trajectory_system.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "server/solve/trajectory/marker_slopes.h"
#include "server/solve/trajectory/trajectory_spline.h"

namespace rigcal::server {
namespace {

constexpr int kMaxHalvings = 8;
constexpr double kSameCentreM = 1e-9;
constexpr double kFreedShare = 0.999;  // so that what is left stays positive definite

// Rows and columns from `first` on.
Eigen::MatrixXd LocalInverse(const BandedMatrix& inverse, Eigen::Index first, Eigen::Index count) {
  Eigen::MatrixXd local(count, count);
  for (Eigen::Index j = 0; j < count; ++j) {
    for (Eigen::Index i = j; i < count; ++i) {
      local(i, j) = local(j, i) = inverse(first + i, first + j);
    }
  }
  return local;
}

BundleProblem RowsInSpans(const TrajectoryProblem& problem) {
  BundleProblem rows = problem.rows;
  for (size_t i = 0; i < rows.instants.size(); ++i) {
    rows.instants[i].used = rows.instants[i].used && problem.span_of_row[i] >= 0;
  }
  return rows;
}

}  // namespace

TrajectorySystem::TrajectorySystem(const BundleOptions& options, TrajectoryProblem* problem)
    : options_(options), problem_(*problem), layout_(LayOut(RowsInSpans(*problem))) {
  packed_.first_entry = {0};
}

double TrajectorySystem::Weight(const Eigen::Vector2d& residual) const {
  if (!options_.robust) return 1;
  return 1 / (1 + residual.squaredNorm() / (options_.loss_scale * options_.loss_scale));
}

bool TrajectorySystem::DataCost(double* cost) const {
  *cost = 0;
  bool visible = true;
  const double c2 = options_.loss_scale * options_.loss_scale;
  ForEachUsedMarkerOfRows(
      problem_, [&](size_t row, const BundleObservation& observation, const BundleMarker& marker) {
        const auto residual = problem_.WhitenedResidual(row, observation, marker);
        visible = visible && residual.has_value();
        if (!residual) return;
        const double square = residual->squaredNorm();
        *cost += 0.5 * (options_.robust ? c2 * std::log1p(square / c2) : square);
      });
  return visible && std::isfinite(*cost);
}

void TrajectorySystem::FreeScale() {
  const BundleProblem& rows = problem_.rows;
  scale_gradient_ = scale_root_ = Eigen::VectorXd::Zero(layout_.column_count());
  if (layout_.spacing_column < 0) return;
  // All lengths grow about the centre of the camera that is held.
  const auto held = std::ranges::find(rows.cameras, true, &BundleCamera::pose_fixed);
  if (held == rows.cameras.end() || held->cam_from_rig.translation_m.norm() > kSameCentreM) return;
  const double path = PathPriorScalePull(problem_);
  double counted = 0, square = 0;
  for (size_t s = 0; s < count_gradient_of_knots_.size(); ++s) {
    const TrajectorySpan& span = problem_.spans[s];
    for (Eigen::Index k = 0; k < span.knot_count(); ++k) {
      const Eigen::Index first = k * span.size;
      counted += count_gradient_of_knots_[s].segment<3>(first).dot(span.knots.segment<3>(first));
    }
  }
  for (int i = 0; i < layout_.column_count(); ++i) {
    const ReducedParameter& parameter = layout_.parameters[static_cast<size_t>(i)];
    const auto index = static_cast<size_t>(parameter.index);
    double length_m = 0;
    if (parameter.kind == ReducedParameterKind::kTranslation) {
      length_m = rows.cameras[index].cam_from_rig.translation_m[parameter.component];
    } else if (parameter.kind == ReducedParameterKind::kMarkerPosition) {
      length_m = rows.target.marker_positions_m[index];
      scale_root_[i] = length_m;
      square += length_m * length_m;
    }
    if (count_gradient_.size() > 0) counted += count_gradient_[i] * length_m;
  }
  if (!(square > 0)) return;
  // Before paths are counted the path is a rough one, which pulls far too much.
  if (count_gradient_.size() > 0) {
    scale_gradient_ = -(scale_pull_.value_or(path) + counted) / square * scale_root_;
  }
  scale_root_ *= std::sqrt(kFreedShare * path) / square;
  gradient_ += scale_gradient_;
  matrix_.selfadjointView<Eigen::Lower>().rankUpdate(scale_root_, -1);
}

bool TrajectorySystem::Linearise() {
  const int columns = layout_.column_count();
  matrix_ = Eigen::MatrixXd::Zero(columns, columns);
  gradient_ = Eigen::VectorXd::Zero(columns);
  systems_.clear();
  for (const TrajectorySpan& span : problem_.spans) {
    SpanSystem& system = systems_.emplace_back();
    system.matrix = BandedMatrix(span.knots.size(), 4 * span.size - 1);
    system.border = Eigen::MatrixXd::Zero(span.knots.size(), columns);
    system.gradient = Eigen::VectorXd::Zero(span.knots.size());
  }
  bool visible = true;
  MarkerSlopes slopes;
  ForEachUsedMarkerOfRows(problem_, [&](size_t row, const BundleObservation& observation,
                                        const BundleMarker& marker) {
    visible = visible && DifferentiateMarker(problem_, layout_, row, observation, marker, &slopes);
    if (!visible) return;
    const double weight = Weight(slopes.residual);
    const auto s = static_cast<size_t>(problem_.span_of_row[row]);
    SpanSystem& system = systems_[s];
    const Eigen::Index first = slopes.weights.first_knot * problem_.spans[s].size;
    const Eigen::Index count = slopes.knots.cols();
    system.gradient.segment(first, count) += weight * slopes.knots.transpose() * slopes.residual;
    for (Eigen::Index j = 0; j < count; ++j) {
      const Eigen::Vector2d column = weight * slopes.knots.col(j);
      for (Eigen::Index i = j; i < count; ++i) {
        system.matrix(first + i, first + j) += slopes.knots.col(i).dot(column);
      }
    }
    for (const auto& [i, d_i] : slopes.reduced) {
      const Eigen::Vector2d weighted = weight * d_i;
      system.border.col(i).segment(first, count) += slopes.knots.transpose() * weighted;
      gradient_[i] += weighted.dot(slopes.residual);
      for (const auto& [j, d_j] : slopes.reduced) {
        if (j <= i) matrix_(i, j) += weighted.dot(d_j);
      }
    }
  });
  if (!visible) return false;
  const LineBundleEstimate estimate(problem_.rows, layout_, packed_);
  estimate.AddPriors(&matrix_, &gradient_);
  if (count_gradient_.size() > 0) gradient_ += count_gradient_;
  FreeScale();
  for (size_t s = 0; s < systems_.size(); ++s) {
    SpanSystem& system = systems_[s];
    AddPathPrior(problem_, s, &system.matrix, &system.gradient);
    if (!count_gradient_of_knots_.empty()) system.gradient += count_gradient_of_knots_[s];
    if (!system.matrix.Factor()) return false;
    system.matrix.SolveLower(system.border);
    system.matrix.SolveLower(system.gradient);
    matrix_.selfadjointView<Eigen::Lower>().rankUpdate(system.border.transpose(), -1);
    gradient_ -= system.border.transpose() * system.gradient;
  }
  double data = 0;
  if (!DataCost(&data)) return false;
  cost_ = data + PathPriorCost(problem_) + estimate.PriorCost();
  return true;
}

bool TrajectorySystem::Step() {
  Eigen::VectorXd reduced = Eigen::VectorXd::Zero(gradient_.size());
  if (gradient_.size() > 0) {
    const Eigen::VectorXd scale = matrix_.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd whole = matrix_.selfadjointView<Eigen::Lower>();
    const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * whole * scale.asDiagonal());
    if (factor.info() != Eigen::Success) return false;
    reduced = -scale.cwiseProduct(factor.solve(scale.cwiseProduct(gradient_)));
  }
  std::vector<Eigen::VectorXd> knot_steps;
  for (const SpanSystem& system : systems_) {
    Eigen::VectorXd step = -(system.gradient + system.border * reduced);
    system.matrix.SolveUpper(step);
    knot_steps.push_back(std::move(step));
  }
  const LineBundleEstimate before(problem_.rows, layout_, packed_);
  LineBundleEstimate moved(problem_.rows, layout_, packed_);
  const std::vector<TrajectorySpan> spans = problem_.spans;
  double counted = 0;
  if (count_gradient_.size() > 0) {
    counted = count_gradient_.dot(reduced);
    for (size_t s = 0; s < spans.size(); ++s) {
      counted += count_gradient_of_knots_[s].dot(knot_steps[s]);
    }
  }
  counted += scale_gradient_.dot(reduced);
  const double bent = 0.5 * std::pow(scale_root_.dot(reduced), 2);
  for (int i = 0; i < kMaxHalvings; ++i) {
    const double length = std::pow(0.5, i);
    moved.MoveReduced(before, length * reduced);
    moved.Store(packed_, &problem_.rows);
    for (size_t s = 0; s < spans.size(); ++s) {
      problem_.spans[s].knots = spans[s].knots + length * knot_steps[s];
    }
    double data = 0;
    if (DataCost(&data) &&
        data + PathPriorCost(problem_) + moved.PriorCost() + length * (counted - length * bent) <
            cost_) {
      return true;
    }
  }
  before.Store(packed_, &problem_.rows);
  problem_.spans = spans;
  return false;
}

PathFreedom TrajectorySystem::MeasureFreedom() const {
  PathFreedom freedom;
  for (size_t s = 0; s < systems_.size(); ++s) {
    AddPathFreedom(problem_, s, systems_[s].inverse, &freedom);
  }
  return freedom;
}

void TrajectorySystem::CountPaths(double variance, std::optional<double> scale_pull) {
  scale_pull_ = scale_pull;
  count_gradient_ = Eigen::VectorXd::Zero(layout_.column_count());
  count_gradient_of_knots_.clear();
  for (const TrajectorySpan& span : problem_.spans) {
    count_gradient_of_knots_.push_back(Eigen::VectorXd::Zero(span.knots.size()));
  }
  MarkerSlopes slopes, moved;
  Eigen::MatrixXd weighted;
  ForEachUsedMarkerOfRows(problem_, [&](size_t row, const BundleObservation& observation,
                                        const BundleMarker& marker) {
    if (!DifferentiateMarker(problem_, layout_, row, observation, marker, &slopes)) return;
    const auto s = static_cast<size_t>(problem_.span_of_row[row]);
    const TrajectorySpan& span = problem_.spans[s];
    const Eigen::Index first = slopes.weights.first_knot * span.size, count = slopes.knots.cols();
    weighted = variance * Weight(slopes.residual) * slopes.knots *
               LocalInverse(systems_[s].inverse, first, count);
    // d (1/2 log det A) = sum of weight * tr(J A^-1 dJ^T) over the markers.
    ForEachUnknownOf(layout_, observation, marker, &problem_.rows, [&](int column, double step) {
      if (!DifferentiateMarker(problem_, layout_, row, observation, marker, &moved)) return;
      const double change = weighted.cwiseProduct(moved.knots - slopes.knots).sum() / step;
      if (moved.weights.first_knot != slopes.weights.first_knot) return;  // as good as none
      count_gradient_[column] += change;
    });
    Eigen::VectorXd& knots = problem_.spans[s].knots;
    for (Eigen::Index c = 0; c < span.size; ++c) {
      // A knot moves the path as the other three do, each by its weight.
      for (Eigen::Index k = 0; k < 4; ++k) knots[first + k * span.size + c] += kKnotStep;
      if (DifferentiateMarker(problem_, layout_, row, observation, marker, &moved)) {
        const double change = weighted.cwiseProduct(moved.knots - slopes.knots).sum() / kKnotStep;
        for (Eigen::Index k = 0; k < 4; ++k) {
          count_gradient_of_knots_[s][first + k * span.size + c] +=
              slopes.weights.value[k] * change;
        }
      }
      for (Eigen::Index k = 0; k < 4; ++k) knots[first + k * span.size + c] -= kKnotStep;
    }
  });
}

void TrajectorySystem::ForEachReduced(const MarkerVisitor& visit) const {
  // The knots' answer to the reduced parameters: minus A^-1 B.
  std::vector<Eigen::MatrixXd> answers;
  for (const SpanSystem& system : systems_) {
    Eigen::MatrixXd answer = system.border;
    for (Eigen::Index c = 0; c < answer.cols(); ++c) system.matrix.SolveUpper(answer.col(c));
    answers.push_back(std::move(answer));
  }
  MarkerSlopes slopes;
  Eigen::Matrix<double, 2, Eigen::Dynamic> slope(2, layout_.column_count());
  ForEachUsedMarkerOfRows(
      problem_, [&](size_t row, const BundleObservation& observation, const BundleMarker& marker) {
        if (!DifferentiateMarker(problem_, layout_, row, observation, marker, &slopes)) return;
        const auto s = static_cast<size_t>(problem_.span_of_row[row]);
        const Eigen::Index first = slopes.weights.first_knot * problem_.spans[s].size;
        slope.noalias() = -slopes.knots * answers[s].middleRows(first, slopes.knots.cols());
        for (const auto& [i, d_i] : slopes.reduced) slope.col(i) += d_i;
        visit(row, Weight(slopes.residual), slopes.residual, slope);
      });
}

void TrajectorySystem::PreparePathCovariance() {
  for (SpanSystem& system : systems_) system.inverse = system.matrix.Inverse();
}

Eigen::Matrix2d TrajectorySystem::PathCovariance(size_t row, const BundleObservation& observation,
                                                 const BundleMarker& marker) const {
  MarkerSlopes slopes;
  if (layout_.ViewIndex(observation.camera, observation.clock) < 0 ||
      !DifferentiateMarker(problem_, layout_, row, observation, marker, &slopes)) {
    return Eigen::Matrix2d::Zero();
  }
  const auto s = static_cast<size_t>(problem_.span_of_row[row]);
  const Eigen::Index first = slopes.weights.first_knot * problem_.spans[s].size;
  return slopes.knots * LocalInverse(systems_[s].inverse, first, slopes.knots.cols()) *
         slopes.knots.transpose();
}

}  // namespace rigcal::server
