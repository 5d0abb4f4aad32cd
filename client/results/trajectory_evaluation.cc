// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory_evaluation.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

constexpr size_t kFewestPositions = 10;
constexpr double kOutlierFactor = 5;     // of the median
constexpr double kOnOneLine = 1e-4;      // second extent as a share of the first
constexpr size_t kMostForSearch = 1500;  // positions that the search for the offset takes
constexpr double kCoarseStepS = 0.004;
constexpr double kFineStepS = 1e-7;

struct Pair {
  double time_s;
  const std::string* label;
  Eigen::Vector3d estimate_m, truth_m;
};

struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d ErrorOf(const Pair& pair) const {
    return scale * (rotation * pair.estimate_m) + translation_m - pair.truth_m;
  }
};

std::vector<Pair> PairsAt(const Trajectories& estimate, const Trajectories& truth, double offset_s,
                          double longest_gap_s, size_t every, size_t* without) {
  std::vector<Pair> pairs;
  *without = 0;
  for (const auto& [label, points] : estimate) {
    const auto found = truth.find(label);
    for (size_t i = 0; i < points.size(); i += every) {
      const auto position =
          found == truth.end()
              ? std::nullopt
              : PositionAt(found->second, points[i].time_s + offset_s, longest_gap_s);
      if (position) {
        pairs.push_back({points[i].time_s, &label, points[i].position_m, *position});
      } else {
        ++*without;
      }
    }
  }
  return pairs;
}

Similarity AlignPairs(const std::vector<const Pair*>& pairs, bool with_scale) {
  Eigen::Matrix3Xd from(3, pairs.size()), to(3, pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = pairs[i]->estimate_m;
    to.col(static_cast<Eigen::Index>(i)) = pairs[i]->truth_m;
  }
  const Eigen::Matrix4d matrix = Eigen::umeyama(from, to, with_scale);
  Similarity fit;
  fit.scale = with_scale ? std::cbrt(matrix.topLeftCorner<3, 3>().determinant()) : 1;
  fit.rotation = matrix.topLeftCorner<3, 3>() / fit.scale;
  fit.translation_m = matrix.topRightCorner<3, 1>();
  return fit;
}

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() +
                  static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::vector<double> DistancesOf(const Similarity& fit, const std::vector<Pair>& pairs) {
  std::vector<double> distances;
  for (const Pair& pair : pairs) distances.push_back(fit.ErrorOf(pair).norm());
  return distances;
}

// Aligned on all positions, then again without the far ones.
Similarity AlignRobustly(const std::vector<Pair>& pairs, bool with_scale) {
  std::vector<const Pair*> used;
  for (const Pair& pair : pairs) used.push_back(&pair);
  Similarity fit = AlignPairs(used, with_scale);
  for (int round = 0; round < 3; ++round) {
    const std::vector<double> distances = DistancesOf(fit, pairs);
    const double limit = kOutlierFactor * Quantile(distances, 0.5);
    used.clear();
    for (size_t i = 0; i < pairs.size(); ++i) {
      if (distances[i] <= limit) used.push_back(&pairs[i]);
    }
    if (used.size() < kFewestPositions) break;
    fit = AlignPairs(used, with_scale);
  }
  return fit;
}

// Of the offset's search: the median, which outliers do not move. Offsets that leave few positions
// in common are worth nothing.
class OffsetSearch {
 public:
  OffsetSearch(const Trajectories& estimate, const Trajectories& truth,
               const TrajectoryEvaluationOptions& options)
      : estimate_(estimate), truth_(truth), options_(options) {
    size_t count = 0;
    for (const auto& [label, points] : estimate) count += points.size();
    every_ = count / kMostForSearch + 1;
  }

  double Best() {
    double best_s = 0, best = CostAt(0);
    const int steps = static_cast<int>(options_.longest_offset_s / kCoarseStepS);
    for (int i = -steps; i <= steps; ++i) {
      const double cost = CostAt(i * kCoarseStepS);
      if (cost < best) best = cost, best_s = i * kCoarseStepS;
    }
    // The cost has one minimum within a step; thirds of the interval (ternary search).
    double low = best_s - kCoarseStepS, high = best_s + kCoarseStepS;
    while (high - low > kFineStepS) {
      const double third = (high - low) / 3;
      if (CostAt(low + third) < CostAt(high - third)) {
        high -= third;
      } else {
        low += third;
      }
    }
    return (low + high) / 2;
  }

 private:
  double CostAt(double offset_s) const {
    size_t without = 0;
    const std::vector<Pair> pairs =
        PairsAt(estimate_, truth_, offset_s, options_.longest_gap_s, every_, &without);
    if (pairs.size() < kFewestPositions || pairs.size() < without) {
      return std::numeric_limits<double>::infinity();
    }
    const std::vector<double> distances =
        DistancesOf(AlignRobustly(pairs, options_.fit_scale), pairs);
    const double limit = kOutlierFactor * Quantile(distances, 0.5);
    double sum = 0;
    for (const double distance : distances) sum += std::min(distance * distance, limit * limit);
    return sum / static_cast<double>(distances.size());
  }

  const Trajectories& estimate_;
  const Trajectories& truth_;
  const TrajectoryEvaluationOptions& options_;
  size_t every_ = 1;
};

absl::Status CheckPairs(const std::vector<Pair>& pairs, size_t without,
                        const Trajectories& estimate, const Trajectories& truth) {
  if (pairs.size() < kFewestPositions) {
    const auto span = [](const Trajectories& all) {
      double first = std::numeric_limits<double>::infinity(), last = -first;
      for (const auto& [label, points] : all) {
        first = std::min(first, points.front().time_s);
        last = std::max(last, points.back().time_s);
      }
      return absl::StrCat(all.size(), " labels, ", FormatFixed(first, 3), " to ",
                          FormatFixed(last, 3), " s");
    };
    return absl::InvalidArgumentError(absl::StrCat(
        "only ", pairs.size(), " positions have ground truth, and ", without,
        " have not; the estimate has ", span(estimate), ", the ground truth ", span(truth)));
  }
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Pair& pair : pairs) mean += pair.truth_m / static_cast<double>(pairs.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Pair& pair : pairs) {
    spread += (pair.truth_m - mean) * (pair.truth_m - mean).transpose();
  }
  const Eigen::Vector3d extents = spread.jacobiSvd().singularValues().cwiseSqrt();
  if (!(extents[1] > kOnOneLine * extents[0])) {
    return absl::InvalidArgumentError(
        "the positions are all on one line, which leaves the rotation of the alignment open");
  }
  return absl::OkStatus();
}

void FillStatistics(TrajectoryEvaluation* result) {
  const double count = static_cast<double>(result->errors.size());
  std::vector<double> distances;
  double mean_time_s = 0;
  for (const TrajectoryEvaluation::Error& error : result->errors) {
    result->mean_m += error.error_m / count;
    result->rmse_m += error.error_m.cwiseAbs2() / count;
    mean_time_s += error.time_s / count;
    distances.push_back(error.error_m.norm());
  }
  result->total_rmse_m = std::sqrt(result->rmse_m.sum());
  result->rmse_m = result->rmse_m.cwiseSqrt();
  result->median_m = Quantile(distances, 0.5);
  result->p95_m = Quantile(distances, 0.95);
  result->worst_m = *std::max_element(distances.begin(), distances.end());
  double spread = 0;
  Eigen::Vector3d together = Eigen::Vector3d::Zero();
  for (const TrajectoryEvaluation::Error& error : result->errors) {
    const double time_s = error.time_s - mean_time_s;
    spread += time_s * time_s;
    together += time_s * (error.error_m - result->mean_m);
  }
  if (spread > 0) result->drift_m_per_s = together / spread;
}

nlohmann::ordered_json VectorJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

absl::StatusOr<TrajectoryEvaluation> EvaluateTrajectories(
    const Trajectories& estimate, const Trajectories& ground_truth,
    const TrajectoryEvaluationOptions& options) {
  if (!(options.longest_offset_s >= 0 && options.longest_offset_s <= 60) ||
      !(options.longest_gap_s > 0)) {
    return absl::InvalidArgumentError(
        "the longest time offset must be 0 to 60 s, and the longest gap more than 0 s");
  }
  TrajectoryEvaluation result;
  if (options.fit_time) {
    result.time_offset_s = OffsetSearch(estimate, ground_truth, options).Best();
  }
  const std::vector<Pair> pairs = PairsAt(estimate, ground_truth, result.time_offset_s,
                                          options.longest_gap_s, 1, &result.without_ground_truth);
  RIGCAL_RETURN_IF_ERROR(CheckPairs(pairs, result.without_ground_truth, estimate, ground_truth));
  const Similarity fit = AlignRobustly(pairs, options.fit_scale);
  result.scale = fit.scale;
  result.truth_from_estimate = RigidTransform(Eigen::Quaterniond(fit.rotation), fit.translation_m);
  for (const Pair& pair : pairs) {
    result.errors.push_back({pair.time_s, *pair.label, fit.ErrorOf(pair)});
  }
  std::stable_sort(result.errors.begin(), result.errors.end(),
                   [](const auto& a, const auto& b) { return a.time_s < b.time_s; });
  FillStatistics(&result);
  return result;
}

std::string FormatTrajectoryEvaluation(const TrajectoryEvaluation& evaluation) {
  constexpr double kMm = 1000, kSecondsPerMinute = 60;
  TextTable table;
  table.Words({"axis"}).Numbers({"mean", "RMSE"}, "error (mm)").Numbers({"drift (mm/min)"});
  const char* const axes[] = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    table.AddRow({axes[i], FormatFixed(evaluation.mean_m[i] * kMm, 3),
                  FormatFixed(evaluation.rmse_m[i] * kMm, 3),
                  FormatFixed(evaluation.drift_m_per_s[i] * kMm * kSecondsPerMinute, 3)});
  }
  const Eigen::Vector3d& t = evaluation.truth_from_estimate.translation_m;
  const Eigen::Quaterniond q = Canonical(evaluation.truth_from_estimate.rotation);
  return Printable(absl::StrCat(
      "Estimate minus ground truth at ", FormatCount(evaluation.errors.size(), "position"), " (",
      evaluation.without_ground_truth, " more have no ground truth), after the best alignment\n",
      "  time offset ", FormatFixed(evaluation.time_offset_s * 1000, 3), " ms, scale ",
      FormatFixed(evaluation.scale, 6), ", translation (", FormatFixed(t.x(), 4), ", ",
      FormatFixed(t.y(), 4), ", ", FormatFixed(t.z(), 4), ") m, rotation w x y z (",
      FormatFixed(q.w(), 6), ", ", FormatFixed(q.x(), 6), ", ", FormatFixed(q.y(), 6), ", ",
      FormatFixed(q.z(), 6), ")\n\n", table.Format(2), "\nDistance  RMSE ",
      FormatFixed(evaluation.total_rmse_m * kMm, 3), " mm, median ",
      FormatFixed(evaluation.median_m * kMm, 3), " mm, p95 ",
      FormatFixed(evaluation.p95_m * kMm, 3), " mm, worst ",
      FormatFixed(evaluation.worst_m * kMm, 3), " mm\n"));
}

std::string ToJson(const TrajectoryEvaluation& evaluation) {
  const Eigen::Quaterniond q = Canonical(evaluation.truth_from_estimate.rotation);
  return JsonText({{"count", evaluation.errors.size()},
                   {"without_ground_truth", evaluation.without_ground_truth},
                   {"time_offset_s", evaluation.time_offset_s},
                   {"scale", evaluation.scale},
                   {"truth_from_estimate",
                    {{"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
                     {"translation_m", VectorJson(evaluation.truth_from_estimate.translation_m)}}},
                   {"mean_m", VectorJson(evaluation.mean_m)},
                   {"rmse_m", VectorJson(evaluation.rmse_m)},
                   {"total_rmse_m", evaluation.total_rmse_m},
                   {"median_m", evaluation.median_m},
                   {"p95_m", evaluation.p95_m},
                   {"worst_m", evaluation.worst_m},
                   {"drift_m_per_s", VectorJson(evaluation.drift_m_per_s)}});
}

}  // namespace rigcal::client
