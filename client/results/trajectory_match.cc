// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory_match.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/quantities.h"

namespace rigcal::client {
namespace {

constexpr double kOutlierFactor = 5;     // of the median
constexpr size_t kMostForSearch = 1500;  // rows that the search's last step takes
constexpr size_t kMostForScan = 300;     // and its first
constexpr double kFineStepS = 0.004;
constexpr int kScanStep =
    5;  // fine steps: a fiftieth of a second, far less than a wave of the wand
constexpr double kLastStepS = 1e-7;
constexpr int kMostThirds = 48;       // (2/3)^48 of the first interval is 3e-9 of it
constexpr double kNearS = 1;          // clocks that somebody has set
constexpr double kClearlyBetter = 4;  // what is left of the motion, near against elsewhere
constexpr double kMostScanSteps = 2e6;
constexpr double kOtherUnit = 1;  // logarithm of a scale

Similarity AlignPairs(const std::vector<const PositionPair*>& pairs, bool with_scale,
                      bool mirrored) {
  Eigen::Matrix3Xd from(3, pairs.size()), to(3, pairs.size());
  const Eigen::Vector3d sides(1, 1, mirrored ? -1 : 1);
  for (size_t i = 0; i < pairs.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = pairs[i]->estimate_m.cwiseProduct(sides);
    to.col(static_cast<Eigen::Index>(i)) = pairs[i]->truth_m;
  }
  const Eigen::Matrix4d matrix = Eigen::umeyama(from, to, with_scale);
  Similarity fit;
  fit.scale = with_scale ? std::cbrt(matrix.topLeftCorner<3, 3>().determinant()) : 1;
  fit.rotation = matrix.topLeftCorner<3, 3>() / fit.scale * sides.asDiagonal();
  fit.translation_m = matrix.topRightCorner<3, 1>();
  return fit;
}

double SpacingOf(const std::vector<TrajectoryPoint>& points) {
  std::vector<double> steps_s;
  for (size_t i = 1; i < points.size(); ++i) {
    steps_s.push_back(points[i].time_s - points[i - 1].time_s);
  }
  return QuantileOf(std::move(steps_s), 0.5);
}

// The share of the motion that no similarity, mirrored or not, explains: 1 minus the squared
// correlation that the singular values of the covariance give (Umeyama 1991, equation 33).
double Unexplained(const std::vector<PositionPair>& pairs) {
  Eigen::Vector3d mean_estimate = Eigen::Vector3d::Zero(), mean_truth = mean_estimate;
  for (const PositionPair& pair : pairs) {
    mean_estimate += pair.estimate_m;
    mean_truth += pair.truth_m;
  }
  mean_estimate /= static_cast<double>(pairs.size());
  mean_truth /= static_cast<double>(pairs.size());
  Eigen::Matrix3d together = Eigen::Matrix3d::Zero();
  double of_estimate = 0, of_truth = 0;
  for (const PositionPair& pair : pairs) {
    const Eigen::Vector3d a = pair.estimate_m - mean_estimate, b = pair.truth_m - mean_truth;
    together += b * a.transpose();
    of_estimate += a.squaredNorm();
    of_truth += b.squaredNorm();
  }
  if (!(of_estimate > 0 && of_truth > 0)) return 1;
  const double explained = together.jacobiSvd().singularValues().sum();
  return std::max(0.0, 1 - explained * explained / (of_estimate * of_truth));
}

class OffsetSearch {
 public:
  OffsetSearch(const TrajectoryMatch& match, bool fit_scale)
      : match_(match),
        fit_scale_(fit_scale),
        every_(match.rows() / kMostForSearch + 1),
        scan_every_(match.rows() / kMostForScan + 1) {}

  struct Best {
    double unexplained = std::numeric_limits<double>::infinity();
    int64_t step = 0;  // times kFineStepS
  };
  // Among whole steps of the scan from `first` to `last`, both in fine steps.
  Best Scan(int64_t first, int64_t last) const {
    struct Offset {
      int64_t step;
      size_t count;
      double unexplained;
    };
    std::vector<Offset> offsets;
    size_t most = 0;
    for (int64_t step = first; step <= last; step += kScanStep) {
      const PositionPairs found =
          match_.PairsAt(static_cast<double>(step) * kFineStepS, scan_every_);
      if (found.pairs.size() * scan_every_ < kFewestPositions || found.pairs.size() < 4) continue;
      offsets.push_back({step, found.pairs.size(), Unexplained(found.pairs)});
      most = std::max(most, found.pairs.size());
    }
    Best best;
    for (const Offset& offset : offsets) {
      const bool nearer = std::abs(offset.step) < std::abs(best.step);
      if (offset.count * 2 < most) continue;
      if (offset.unexplained < best.unexplained ||
          (offset.unexplained == best.unexplained && nearer)) {
        best = {offset.unexplained, offset.step};
      }
    }
    return best;
  }

  // Around a step of the scan, by the robust error.
  double Refine(int64_t around) {
    const std::vector<PositionPair> pairs =
        match_.PairsAt(static_cast<double>(around) * kFineStepS, every_).pairs;
    least_ = pairs.size() / 2;
    // Wrong units or axes, which others will name, leave a rigid fit without a clear minimum.
    const Similarity similarity = AlignRobustly(pairs, true);
    const auto median = [&](bool mirrored) {
      return QuantileOf(DistancesOf(AlignRobustly(pairs, true, mirrored), pairs), 0.5);
    };
    fit_scale_ = fit_scale_ || std::abs(std::log(similarity.scale)) > kOtherUnit;
    mirrored_ = median(true) < median(false);
    int64_t best_step = around;
    double best = CostAt(static_cast<double>(around) * kFineStepS);
    for (int64_t step = around - 2 * kScanStep; step <= around + 2 * kScanStep; ++step) {
      const double cost = CostAt(static_cast<double>(step) * kFineStepS);
      if (cost < best) best = cost, best_step = step;
    }
    // The cost has one minimum within a step; thirds of the interval (ternary search).
    const double best_s = static_cast<double>(best_step) * kFineStepS;
    double low = best_s - kFineStepS, high = best_s + kFineStepS;
    // Of large offsets doubles are further apart than kLastStepS.
    for (int step = 0; step < kMostThirds && high - low > kLastStepS; ++step) {
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
    const std::vector<PositionPair> pairs = match_.PairsAt(offset_s, every_).pairs;
    if (pairs.size() < 4 || pairs.size() < least_) return std::numeric_limits<double>::infinity();
    const std::vector<double> distances =
        DistancesOf(AlignRobustly(pairs, fit_scale_, mirrored_), pairs);
    const double limit = kOutlierFactor * QuantileOf(distances, 0.5);
    double sum = 0;
    for (const double distance : distances) sum += std::min(distance * distance, limit * limit);
    return sum / static_cast<double>(distances.size());
  }

  const TrajectoryMatch& match_;
  bool fit_scale_;
  bool mirrored_ = false;
  const size_t every_, scan_every_;
  size_t least_ = 0;
};

std::string QuotedLabels(const Trajectories& trajectories) {
  std::vector<std::string> names;
  for (const auto& [label, points] : trajectories) names.push_back(absl::StrCat("\"", label, "\""));
  if (names.size() == 1 && trajectories.begin()->first.empty()) return "none";
  return absl::StrJoin(names, ", ");
}

}  // namespace

double QuantileOf(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() +
                  static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

std::vector<double> DistancesOf(const Similarity& fit, const std::vector<PositionPair>& pairs) {
  std::vector<double> distances;
  for (const PositionPair& pair : pairs) distances.push_back(fit.ErrorOf(pair).norm());
  return distances;
}

Similarity AlignRobustly(const std::vector<PositionPair>& pairs, bool with_scale, bool mirrored) {
  std::vector<const PositionPair*> used;
  for (const PositionPair& pair : pairs) used.push_back(&pair);
  Similarity fit = AlignPairs(used, with_scale, mirrored);
  for (int round = 0; round < 3; ++round) {
    const std::vector<double> distances = DistancesOf(fit, pairs);
    const double limit = kOutlierFactor * QuantileOf(distances, 0.5);
    used.clear();
    for (size_t i = 0; i < pairs.size(); ++i) {
      if (distances[i] <= limit) used.push_back(&pairs[i]);
    }
    if (used.size() < kFewestPositions) break;
    fit = AlignPairs(used, with_scale, mirrored);
  }
  return fit;
}

absl::StatusOr<TrajectoryMatch> TrajectoryMatch::Make(const Trajectories& estimate,
                                                      const Trajectories& truth,
                                                      double longest_gap_s) {
  TrajectoryMatch match;
  for (const auto& [label, points] : estimate) {
    const auto found = truth.find(label);
    if (found != truth.end()) {
      match.points_.push_back({&label, &points, &found->second});
    } else if (estimate.size() == 1 && truth.size() == 1) {
      match.points_.push_back({&label, &points, &truth.begin()->second});
    } else {
      match.unmatched_.push_back(label);
      match.unmatched_rows_ += points.size();
    }
  }
  if (match.points_.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("no point is in both files: the estimate's labels are ",
                     QuotedLabels(estimate), ", the ground truth's ", QuotedLabels(truth),
                     "; give the ground truth a column label with the estimate's names"));
  }
  std::vector<double> of_estimate_s, of_truth_s;
  double first = std::numeric_limits<double>::infinity(), last = -first;
  for (const Point& point : match.points_) {
    of_estimate_s.push_back(SpacingOf(*point.estimate));
    of_truth_s.push_back(SpacingOf(*point.truth));
    first = std::min(first, point.truth->front().time_s - point.estimate->back().time_s);
    last = std::max(last, point.truth->back().time_s - point.estimate->front().time_s);
  }
  match.first_offset_s_ = first;
  match.last_offset_s_ = last;
  const double estimate_s = QuantileOf(of_estimate_s, 0.5), truth_s = QuantileOf(of_truth_s, 0.5);
  match.interpolates_truth_ = !(truth_s > 1.5 * estimate_s);
  match.spacing_s_ = match.interpolates_truth_ ? truth_s : estimate_s;
  // Rows at the interpolated one's own rate are no gap, whatever the rate is.
  match.longest_gap_s_ = std::max(longest_gap_s, 1.5 * match.spacing_s_);
  for (const Point& point : match.points_) {
    match.rows_ += (match.interpolates_truth_ ? point.estimate : point.truth)->size();
  }
  return match;
}

PositionPairs TrajectoryMatch::PairsAt(double offset_s, size_t every) const {
  PositionPairs found;
  found.without = interpolates_truth_ ? unmatched_rows_ / every : 0;
  for (const Point& point : points_) {
    const auto& rows = interpolates_truth_ ? *point.estimate : *point.truth;
    for (size_t i = 0; i < rows.size(); i += every) {
      const TrajectoryPoint& row = rows[i];
      const auto other = interpolates_truth_
                             ? PositionAt(*point.truth, row.time_s + offset_s, longest_gap_s_)
                             : PositionAt(*point.estimate, row.time_s - offset_s, longest_gap_s_);
      if (!other) {
        ++found.without;
      } else if (interpolates_truth_) {
        found.pairs.push_back({row.time_s, point.label, row.position_m, *other});
      } else {
        found.pairs.push_back({row.time_s - offset_s, point.label, *other, row.position_m});
      }
    }
  }
  return found;
}

absl::StatusOr<double> FindTimeOffset(const TrajectoryMatch& match,
                                      const OffsetSearchOptions& options) {
  const double longest_s = options.longest_offset_s.value_or(1e12);
  const double first_s = std::max(match.first_offset_s(), -longest_s);
  const double last_s = std::min(match.last_offset_s(), longest_s);
  const auto step_of = [](double offset_s) {
    return static_cast<int64_t>(std::floor(offset_s / kFineStepS / kScanStep)) * kScanStep;
  };
  if (last_s < first_s || (last_s - first_s) / (kScanStep * kFineStepS) > kMostScanSteps) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the two overlap in time at offsets from ", FormatFixed(match.first_offset_s(), 3), " to ",
        FormatFixed(match.last_offset_s(), 3), " s, and ",
        last_s < first_s ? absl::StrCat("only ", FormatFixed(longest_s, 3), " s are searched: ")
                         : "that is too much to search: ",
        "subtract a common time from both, or give --longest-offset"));
  }
  OffsetSearch search(match, options.fit_scale);
  OffsetSearch::Best best;
  if (first_s <= kNearS && last_s >= -kNearS) {
    best = search.Scan(step_of(std::max(first_s, -kNearS)), step_of(std::min(last_s, kNearS)));
  }
  if (first_s < -kNearS || last_s > kNearS) {
    const OffsetSearch::Best far = search.Scan(step_of(first_s), step_of(last_s));
    if (far.unexplained * kClearlyBetter < best.unexplained) best = far;
  }
  if (std::isinf(best.unexplained)) {
    return absl::InvalidArgumentError(
        "fewer than 10 rows of the two are of the same time at any offset searched");
  }
  const double offset_s = search.Refine(best.step);
  if (options.longest_offset_s && longest_s > 0 &&
      std::abs(offset_s) > longest_s - kScanStep * kFineStepS / 2 &&
      (longest_s < match.last_offset_s() || -longest_s > match.first_offset_s())) {
    return absl::InvalidArgumentError(
        absl::StrCat("the best time offset is at the end of the searched ones, ",
                     FormatFixed(longest_s, 3), " s: search further with --longest-offset"));
  }
  return offset_s;
}

}  // namespace rigcal::client
