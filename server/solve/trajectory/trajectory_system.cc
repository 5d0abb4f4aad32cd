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

void TrajectorySystem::FindScaleDirection() {
  const BundleProblem& rows = problem_.rows;
  scale_.reset();
  if (layout_.spacing_column < 0) return;
  const std::optional<Eigen::Vector3d> centre_m = FixedCentre(rows);
  if (!centre_m) return;
  ScaleDirection scale{*centre_m, Eigen::VectorXd::Zero(layout_.column_count()),
                       Eigen::VectorXd::Zero(layout_.column_count())};
  double square = 0;
  for (int i = 0; i < layout_.column_count(); ++i) {
    const ReducedParameter& parameter = layout_.parameters[static_cast<size_t>(i)];
    const auto index = static_cast<size_t>(parameter.index);
    if (parameter.kind == ReducedParameterKind::kTranslation) {
      const RigidTransform& pose = rows.cameras[index].cam_from_rig;
      scale.reduced[i] = (pose * *centre_m)[parameter.component];
    } else if (parameter.kind == ReducedParameterKind::kMarkerPosition) {
      scale.reduced[i] = scale.size_slope[i] = rows.target.marker_positions_m[index];
      square += scale.reduced[i] * scale.reduced[i];
    }
  }
  if (!(square > 0)) return;
  scale.size_slope /= square;
  scale_ = std::move(scale);
}

double TrajectorySystem::SizeM() const {
  double square = 0;
  for (const double position_m : problem_.rows.target.marker_positions_m) {
    square += position_m * position_m;
  }
  return std::sqrt(square);
}

void TrajectorySystem::AddPath(size_t span_index) {
  SpanSystem& system = systems_[span_index];
  const TrajectorySpan& span = problem_.spans[span_index];
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(span.knots.size());
  AddPathPrior(problem_, span_index, &system.matrix, &pull);
  system.gradient += pull;
  if (!scale_) return;
  // Of the origins alone: directions have no size.
  double by_size = 0;
  for (Eigen::Index k = 0; k < span.knot_count(); ++k) {
    const Eigen::Index first = k * span.size;
    by_size += pull.segment<3>(first).dot(span.knots.segment<3>(first));
    if (span.has_direction()) pull.segment<3>(first + 3).setZero();
  }
  // A third difference over a sigma that grows with the wand: its derivative by the wand's size is
  // minus itself.
  system.border.noalias() -= pull * scale_->size_slope.transpose();
  matrix_.selfadjointView<Eigen::Lower>().rankUpdate(scale_->size_slope, by_size);
  gradient_ -= by_size * scale_->size_slope;
}

void TrajectorySystem::AddCount() {
  counted_ = count_gradient_;
  if (counted_.size() == 0) return;
  if (scale_) {
    double counted = counted_.dot(scale_->reduced);
    for (size_t s = 0; s < systems_.size(); ++s) {
      const TrajectorySpan& span = problem_.spans[s];
      for (Eigen::Index k = 0; k < span.knot_count(); ++k) {
        const Eigen::Index first = k * span.size;
        counted += count_gradient_of_knots_[s].segment<3>(first).dot(span.knots.segment<3>(first) -
                                                                     scale_->centre_m);
      }
    }
    counted_ -= counted * scale_->size_slope;
  }
  gradient_ += counted_;
  for (size_t s = 0; s < systems_.size(); ++s) systems_[s].gradient += count_gradient_of_knots_[s];
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
  FindScaleDirection();
  for (size_t s = 0; s < systems_.size(); ++s) AddPath(s);
  AddCount();
  for (SpanSystem& system : systems_) {
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

TrajectorySystem::StepOutcome TrajectorySystem::Step() {
  Eigen::VectorXd reduced = Eigen::VectorXd::Zero(gradient_.size());
  if (gradient_.size() > 0) {
    const Eigen::VectorXd scale = matrix_.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd whole = matrix_.selfadjointView<Eigen::Lower>();
    const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * whole * scale.asDiagonal());
    if (factor.info() != Eigen::Success) return StepOutcome::kSingular;
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
  const double origin_sigma = problem_.origin_sigma, size_m = SizeM();
  double counted = 0;
  if (counted_.size() > 0) {
    counted = counted_.dot(reduced);
    for (size_t s = 0; s < spans.size(); ++s) {
      counted += count_gradient_of_knots_[s].dot(knot_steps[s]);
    }
  }
  for (int i = 0; i < kMaxHalvings; ++i) {
    const double length = std::pow(0.5, i);
    moved.MoveReduced(before, length * reduced);
    moved.Store(packed_, &problem_.rows);
    for (size_t s = 0; s < spans.size(); ++s) {
      problem_.spans[s].knots = spans[s].knots + length * knot_steps[s];
    }
    if (scale_) problem_.origin_sigma = origin_sigma * SizeM() / size_m;
    double data = 0;
    if (DataCost(&data) &&
        data + PathPriorCost(problem_) + moved.PriorCost() + length * counted < cost_) {
      return StepOutcome::kTaken;
    }
  }
  before.Store(packed_, &problem_.rows);
  problem_.spans = spans;
  problem_.origin_sigma = origin_sigma;
  return StepOutcome::kNoGain;
}

PathFreedom TrajectorySystem::MeasureFreedom() const {
  PathFreedom freedom;
  for (size_t s = 0; s < systems_.size(); ++s) {
    AddPathFreedom(problem_, s, systems_[s].inverse, &freedom);
  }
  return freedom;
}

void TrajectorySystem::CountPaths(double variance) {
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
