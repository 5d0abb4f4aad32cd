// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory_clock.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rigcal::client {
namespace {

constexpr int kPieces = 8;
constexpr int kFewestPieces = 4;
constexpr double kShortestPieceS = 1;
constexpr double kLargestRate = 0.03;
// Rows of recordings of one motion come at rates that differ by less.
constexpr double kSimilarRates = 30;

struct ClockSpan {
  double first_s = std::numeric_limits<double>::infinity(), last_s = -first_s;
};

ClockSpan ClockSpanOf(const Trajectories& all) {
  ClockSpan span;
  for (const auto& [label, points] : all) {
    span.first_s = std::min(span.first_s, points.front().time_s);
    span.last_s = std::max(span.last_s, points.back().time_s);
  }
  return span;
}

Trajectories PieceOf(const Trajectories& all, double from_s, double to_s) {
  Trajectories piece;
  for (const auto& [label, points] : all) {
    std::vector<TrajectoryPoint> rows;
    for (const TrajectoryPoint& point : points) {
      if (point.time_s >= from_s && point.time_s <= to_s) rows.push_back(point);
    }
    if (rows.size() >= kFewestPositions) piece[label] = std::move(rows);
  }
  return piece;
}

// The median of the slopes of all pairs (Theil 1950), which pieces that fit nowhere do not move.
double SlopeOf(const std::vector<Eigen::Vector2d>& points) {
  std::vector<double> slopes;
  for (size_t i = 0; i < points.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      slopes.push_back((points[i].y() - points[j].y()) / (points[i].x() - points[j].x()));
    }
  }
  return QuantileOf(std::move(slopes), 0.5);
}

double ErrorAtBestOffset(const Trajectories& estimate, const Trajectories& truth, double gap_s,
                         double longest_offset_s, bool fit_scale, double* offset_s) {
  const double none = std::numeric_limits<double>::infinity();
  const auto match = TrajectoryMatch::Make(estimate, truth, gap_s);
  if (!match.ok()) return none;
  const auto found =
      FindTimeOffset(*match, {.fit_scale = fit_scale, .longest_offset_s = longest_offset_s});
  if (!found.ok()) return none;
  *offset_s = *found;
  const std::vector<PositionPair> pairs = match->PairsAt(*found).pairs;
  if (pairs.size() < kFewestPositions) return none;
  return QuantileOf(DistancesOf(AlignRobustly(pairs, fit_scale), pairs), 0.5);
}

}  // namespace

Trajectories WithClock(const Trajectories& all, double factor, double about_s) {
  Trajectories changed = all;
  for (auto& [label, points] : changed) {
    for (TrajectoryPoint& point : points) {
      point.time_s = about_s + factor * (point.time_s - about_s);
    }
  }
  return changed;
}

double TypicalSpacingS(const Trajectories& all) {
  std::vector<double> steps_s;
  for (const auto& [label, points] : all) {
    for (size_t i = 1; i < points.size(); ++i) {
      steps_s.push_back(points[i].time_s - points[i - 1].time_s);
    }
  }
  return QuantileOf(std::move(steps_s), 0.5);
}

std::optional<double> FindClockRate(const Trajectories& estimate, const Trajectories& ground_truth,
                                    double offset_s, double longest_gap_s, bool fit_scale) {
  // On the clock of the estimate, as far as is known.
  Trajectories truth = ground_truth;
  for (auto& [label, points] : truth) {
    for (TrajectoryPoint& point : points) point.time_s -= offset_s;
  }
  const ClockSpan of_estimate = ClockSpanOf(estimate), of_truth = ClockSpanOf(truth);
  const double first_s = std::max(of_estimate.first_s, of_truth.first_s);
  const double last_s = std::min(of_estimate.last_s, of_truth.last_s);
  const double length_s = (last_s - first_s) / kPieces;
  if (!(length_s > kShortestPieceS)) return std::nullopt;
  const double middle_s = (first_s + last_s) / 2;
  double factor = 1;
  double reach_s = kLargestRate * (last_s - first_s) + 1;
  for (int round = 0; round < 3; ++round) {
    std::vector<Eigen::Vector2d> offsets;
    for (int i = 0; i < kPieces; ++i) {
      const double from_s = first_s + i * length_s;
      const Trajectories piece = PieceOf(estimate, from_s, from_s + length_s);
      if (piece.empty()) continue;
      double piece_offset_s = 0;
      const double error_m =
          ErrorAtBestOffset(piece, truth, longest_gap_s, reach_s, fit_scale, &piece_offset_s);
      if (std::isinf(error_m)) continue;
      offsets.emplace_back(from_s + length_s / 2, piece_offset_s);
    }
    if (static_cast<int>(offsets.size()) < kFewestPieces) return std::nullopt;
    // Times of the truth are those of the estimate times 1 + slope.
    const double step = 1 / (1 + SlopeOf(offsets));
    if (!(std::abs(factor * step - 1) < kLargestRate)) return std::nullopt;
    factor *= step;
    truth = WithClock(truth, step, middle_s);
    // What all pieces have in common.
    double common_s = 0;
    if (std::isinf(
            ErrorAtBestOffset(estimate, truth, longest_gap_s, reach_s, fit_scale, &common_s))) {
      return std::nullopt;
    }
    for (auto& [label, points] : truth) {
      for (TrajectoryPoint& point : points) point.time_s -= common_s;
    }
    reach_s = std::min(reach_s, 1.0);
  }
  return factor;
}

std::vector<double> PossibleTimeUnits(const Trajectories& estimate,
                                      const Trajectories& ground_truth) {
  const double of_estimate_s = TypicalSpacingS(estimate);
  const double of_truth_s = TypicalSpacingS(ground_truth);
  std::vector<double> factors;
  if (!(of_estimate_s > 0 && of_truth_s > 0)) return factors;
  const auto similar = [&](double factor) {
    const double ratio = factor * of_truth_s / of_estimate_s;
    return ratio < kSimilarRates && ratio * kSimilarRates > 1;
  };
  if (similar(1)) return factors;
  for (const double factor : {1e-3, 1e3, 1e-6, 1e6, 1e-9, 1e9}) {
    if (similar(factor)) factors.push_back(factor);
  }
  return factors;
}

}  // namespace rigcal::client
