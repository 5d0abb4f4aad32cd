// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory_evaluation.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/quantities.h"
#include "client/results/trajectory_clock.h"
#include "client/results/trajectory_match.h"
#include "common/scale/unit_ratio.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

constexpr double kOnOneLine = 1e-4;  // second extent as a share of the first
// What another way to align must improve the median by, to be the explanation.
constexpr double kExplains = 5;
// A median error of this share of the motion is no fit at all.
constexpr double kNoFit = 0.25;
// From this share on other causes are looked for.
constexpr double kPoorFit = 0.05;
constexpr double kGoodFit = 1e-4;  // and up to this nothing is
// What an offset that grows with time must explain of the squared errors to be looked at, and what
// it must divide the median by to be told.
constexpr double kRateShare = 0.1, kRateExplains = 2;
constexpr double kLongSpacingS = 2;
constexpr double kWorthSayingM = 1e-6;

absl::Status CheckPairs(const std::vector<PositionPair>& pairs, size_t without,
                        const Trajectories& estimate, const Trajectories& truth) {
  if (pairs.size() < kFewestPositions) {
    const auto span = [](const Trajectories& all) {
      double first = std::numeric_limits<double>::infinity(), last = -first;
      for (const auto& [label, points] : all) {
        first = std::min(first, points.front().time_s);
        last = std::max(last, points.back().time_s);
      }
      return absl::StrCat(FormatFixed(first, 3), " to ", FormatFixed(last, 3), " s");
    };
    return absl::InvalidArgumentError(
        absl::StrCat("only ", pairs.size(), " positions have ground truth, and ", without,
                     " have not; the estimate is from ", span(estimate), ", the ground truth from ",
                     span(truth)));
  }
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const PositionPair& pair : pairs) mean += pair.truth_m / static_cast<double>(pairs.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const PositionPair& pair : pairs) {
    spread += (pair.truth_m - mean) * (pair.truth_m - mean).transpose();
  }
  const Eigen::Vector3d extents = spread.jacobiSvd().singularValues().cwiseSqrt();
  if (!(extents[1] > kOnOneLine * extents[0])) {
    return absl::InvalidArgumentError(
        "the positions are all on one line, which leaves the rotation of the alignment open");
  }
  return absl::OkStatus();
}

// Root mean square of the distances from the middle.
double ExtentOf(const std::vector<PositionPair>& pairs) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const PositionPair& pair : pairs) mean += pair.truth_m / static_cast<double>(pairs.size());
  double sum = 0;
  for (const PositionPair& pair : pairs) sum += (pair.truth_m - mean).squaredNorm();
  return std::sqrt(sum / static_cast<double>(pairs.size()));
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
  result->median_m = QuantileOf(distances, 0.5);
  result->p95_m = QuantileOf(distances, 0.95);
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

// The names of factors that people meet where a unit is wrong.
std::string UnitOf(double scale) {
  constexpr double kTolerance = 0.05;
  if (const std::string unit = UnitOfRatio(scale, kTolerance); !unit.empty()) {
    return absl::StrCat("is the ground truth in ", unit, "? Give it in metres");
  }
  if (const std::string unit = UnitOfRatio(1 / scale, kTolerance); !unit.empty()) {
    return absl::StrCat("is the estimate in ", unit, "? Give it in metres");
  }
  return "";
}

double MedianError(const std::vector<PositionPair>& pairs, bool with_scale, bool mirrored,
                   double* scale) {
  const Similarity fit = AlignRobustly(pairs, with_scale, mirrored);
  *scale = fit.scale;
  return QuantileOf(DistancesOf(fit, pairs), 0.5);
}

double SpreadOf(const Trajectories& all) {
  std::vector<PositionPair> pairs;
  for (const auto& [label, points] : all) {
    for (const TrajectoryPoint& point : points) {
      pairs.push_back({point.time_s, &label, point.position_m, point.position_m});
    }
  }
  return ExtentOf(pairs);
}

std::string FormatSpacing(const Trajectories& all) {
  return absl::StrCat(FormatFixed(TypicalSpacingS(all), 3), " s");
}

// Whether errors along the motion grow with time, or are large anyhow: to first order an error of
// the clock is the velocity times an offset that grows.
bool RateMayMatter(const Similarity& fit, const std::vector<PositionPair>& pairs, double median_m) {
  const double extent_m = ExtentOf(pairs);
  if (median_m < kGoodFit * extent_m) return false;
  if (median_m > kPoorFit * extent_m) return true;
  double first_s = pairs.front().time_s, last_s = first_s;
  for (const PositionPair& pair : pairs) {
    first_s = std::min(first_s, pair.time_s);
    last_s = std::max(last_s, pair.time_s);
  }
  const double middle_s = (first_s + last_s) / 2, limit_m = 5 * median_m;
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  double squares = 0;
  for (size_t i = 1; i < pairs.size(); ++i) {
    const PositionPair &a = pairs[i - 1], &b = pairs[i];
    const double step_s = b.time_s - a.time_s;
    if (a.label != b.label || !(step_s > 0)) continue;
    const Eigen::Vector3d error_m = fit.ErrorOf(b), velocity = (b.truth_m - a.truth_m) / step_s;
    if (error_m.norm() > limit_m) continue;
    const Eigen::Vector2d times(1, b.time_s - middle_s);
    normal += times * times.transpose() * velocity.squaredNorm();
    right += times * velocity.dot(error_m);
    squares += error_m.squaredNorm();
  }
  const double explained = right.dot(normal.ldlt().solve(right));
  return squares > 0 && explained > kRateShare * squares;
}

// Wrong units and mirrored axes are errors; a scale that fits better is a note.
absl::Status ExplainMisfit(const std::vector<PositionPair>& pairs, bool fit_scale, double median_m,
                           std::vector<std::string>* notes) {
  // Against no improvement at all, of a fit that is as good as the numbers are.
  const double floor_m = 1e-9;
  double unused = 1, scale = 1, mirrored_scale = 1;
  const double scaled_m = MedianError(pairs, true, false, &scale);
  const double mirrored_m = MedianError(pairs, true, true, &mirrored_scale);
  const double mirrored_rigid_m = MedianError(pairs, fit_scale, true, &unused);
  const bool mirror_explains = kExplains * (mirrored_m + floor_m) < std::min(scaled_m, median_m);
  if (mirror_explains) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the two fit mirrored, to ", FormatFixed(1000 * mirrored_m, 3), " mm: one axis of the ",
        "ground truth points the other way; change the sign of one column",
        kExplains * mirrored_m < mirrored_rigid_m
            ? absl::StrCat(", and note the scale of ", FormatFixed(mirrored_scale, 6))
            : ""));
  }
  const std::string unit = UnitOf(scale);
  const bool scale_explains = kExplains * (scaled_m + floor_m) < median_m;
  if (scale_explains && !fit_scale && !unit.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the two fit with a scale of ", FormatFixed(scale, 3), ", to ",
                     FormatFixed(1000 * scaled_m / std::max(1.0, scale), 3), " mm: ", unit,
                     ", or fit the scale, too, with --scale"));
  }
  if (scale_explains && !fit_scale) {
    notes->push_back(absl::StrCat("with a scale of ", FormatFixed(scale, 6),
                                  " the median error would be ", FormatFixed(1000 * scaled_m, 3),
                                  " mm (--scale)"));
  }
  if (fit_scale && !unit.empty()) {
    notes->push_back(absl::StrCat("the scale is ", FormatFixed(scale, 3), ": ", unit));
  }
  return absl::OkStatus();
}

// The error that interpolation adds: a cubic through every second row misses the rows between by
// sixteen times as much, where the path is smooth.
double InterpolationErrorM(const std::vector<TrajectoryPoint>& rows) {
  std::vector<TrajectoryPoint> half;
  for (size_t i = 0; i < rows.size(); i += 2) half.push_back(rows[i]);
  std::vector<double> errors_m;
  for (size_t i = 1; i + 1 < rows.size(); i += 2) {
    const double gap_s = rows[i + 1].time_s - rows[i - 1].time_s;
    const auto position = PositionAt(half, rows[i].time_s, 1.01 * gap_s);
    if (position) errors_m.push_back((*position - rows[i].position_m).norm() / 16);
  }
  return QuantileOf(std::move(errors_m), 0.5);
}

void NoteTimes(const TrajectoryMatch& match, const Trajectories& interpolated,
               TrajectoryEvaluation* result) {
  if (!match.unmatched().empty()) {
    result->notes.push_back(absl::StrCat("the ground truth has nothing of ",
                                         match.unmatched().size() == 1 ? "label " : "labels ",
                                         absl::StrJoin(match.unmatched(), ", ")));
  }
  if (!match.interpolates_truth()) {
    result->notes.push_back(
        "the ground truth has fewer rows a second: its rows are compared with the estimate, "
        "interpolated");
  }
  const double error_m = InterpolationErrorM(interpolated.begin()->second);
  if (error_m > 0.3 * result->median_m && error_m > kWorthSayingM) {
    result->notes.push_back(absl::StrCat("of the error about ", FormatFixed(1000 * error_m, 3),
                                         " mm can be interpolation between rows ",
                                         FormatFixed(1000 * match.interpolated_spacing_s(), 0),
                                         " ms apart"));
  }
  if (std::abs(result->time_offset_s) > 1) {
    result->notes.push_back(absl::StrCat(
        "the two clocks are ", FormatFixed(std::abs(result->time_offset_s), 3), " s apart"));
  }
}

// INVALID_ARGUMENT: the two fit if the times of one are taken for milliseconds (or less).
absl::Status ExplainTimeUnits(const Trajectories& estimate, const Trajectories& ground_truth,
                              const TrajectoryEvaluationOptions& options) {
  for (const double factor : PossibleTimeUnits(estimate, ground_truth)) {
    const bool of_truth = factor < 1;
    const double step = of_truth ? factor : 1 / factor;
    const Trajectories changed = WithClock(of_truth ? ground_truth : estimate, step, 0);
    TrajectoryEvaluationOptions again = options;
    again.fit_time = true;
    const auto fit = of_truth ? EvaluateTrajectories(estimate, changed, again)
                              : EvaluateTrajectories(changed, ground_truth, again);
    // Whatever else is wrong with them is said once this is mended.
    const std::string error(fit.status().message());
    const bool same_motion = fit.ok() ? fit->median_m < kPoorFit * SpreadOf(ground_truth)
                                      : absl::StrContains(error, "the two fit");
    if (!same_motion) continue;
    const char* const unit = step > 5e-4   ? "milliseconds"
                             : step > 5e-7 ? "microseconds"
                                           : "nanoseconds";
    return absl::InvalidArgumentError(absl::StrCat(
        "rows of the estimate are ", FormatSpacing(estimate), " apart, those of the ground truth ",
        FormatSpacing(ground_truth), ", and the two fit with the times of the ",
        of_truth ? "ground truth" : "estimate", " times ", step, ": are they ", unit,
        "? Name the column time_",
        step > 5e-4   ? "ms"
        : step > 5e-7 ? "us"
                      : "ns"));
  }
  return absl::OkStatus();
}

// How the clock of the ground truth runs, if that explains errors; empty otherwise.
std::string ExplainRate(const Trajectories& estimate, const Trajectories& ground_truth,
                        const TrajectoryEvaluationOptions& options, double offset_s,
                        const Similarity& fit, const std::vector<PositionPair>& pairs) {
  const double median_m = QuantileOf(DistancesOf(fit, pairs), 0.5);
  if (!options.fit_time || !RateMayMatter(fit, pairs, median_m)) return "";
  const auto factor =
      FindClockRate(estimate, ground_truth, offset_s, options.longest_gap_s, options.fit_scale);
  if (!factor) return "";
  const Trajectories changed =
      WithClock(ground_truth, *factor, ground_truth.begin()->second[0].time_s);
  const auto match = TrajectoryMatch::Make(estimate, changed, options.longest_gap_s);
  if (!match.ok()) return "";
  const auto offset =
      FindTimeOffset(*match, {.fit_scale = options.fit_scale, .longest_offset_s = std::nullopt});
  if (!offset.ok()) return "";
  const std::vector<PositionPair> better = match->PairsAt(*offset).pairs;
  if (better.size() < kFewestPositions || better.size() * 2 < pairs.size()) return "";
  double unused = 1;
  const double turned_m = MedianError(better, options.fit_scale, false, &unused);
  const double mirrored_m = MedianError(better, options.fit_scale, true, &unused);
  const bool mirrored = kExplains * mirrored_m < turned_m;
  const double better_m = mirrored ? mirrored_m : turned_m;
  if (!(kRateExplains * better_m < median_m)) return "";
  return absl::StrCat(
      "the clock of the ground truth runs ", FormatFixed(100 * std::abs(1 / *factor - 1), 4),
      " % too ", *factor < 1 ? "fast" : "slow", ": with its times times ", FormatFixed(*factor, 7),
      " the median error would be ", FormatFixed(1000 * better_m, 3), " mm instead of ",
      FormatFixed(1000 * median_m, 3), " mm",
      mirrored ? ", and mirrored: one axis points the other way" : "");
}

// Nobody samples a moving wand so slowly.
void NoteLongSpacing(const Trajectories& all, const char* of, std::vector<std::string>* notes) {
  if (TypicalSpacingS(all) < kLongSpacingS) return;
  notes->push_back(absl::StrCat("rows of the ", of, " are ", FormatSpacing(all),
                                " apart: are its times in milliseconds? Name the column time_ms"));
}

}  // namespace

absl::StatusOr<TrajectoryEvaluation> EvaluateTrajectories(
    const Trajectories& estimate, const Trajectories& ground_truth,
    const TrajectoryEvaluationOptions& options) {
  RIGCAL_RETURN_IF_ERROR(ExplainTimeUnits(estimate, ground_truth, options));
  if ((options.longest_offset_s && !(*options.longest_offset_s >= 0)) ||
      !(options.longest_gap_s > 0)) {
    return absl::InvalidArgumentError(
        "the longest time offset must be 0 s or more, and the longest gap more than 0 s");
  }
  RIGCAL_ASSIGN_OR_RETURN(const TrajectoryMatch match,
                          TrajectoryMatch::Make(estimate, ground_truth, options.longest_gap_s));
  TrajectoryEvaluation result;
  if (options.fit_time) {
    RIGCAL_ASSIGN_OR_RETURN(result.time_offset_s,
                            FindTimeOffset(match, {.fit_scale = options.fit_scale,
                                                   .longest_offset_s = options.longest_offset_s}));
  }
  const PositionPairs found = match.PairsAt(result.time_offset_s);
  const std::vector<PositionPair>& pairs = found.pairs;
  result.without_ground_truth = found.without;
  RIGCAL_RETURN_IF_ERROR(CheckPairs(pairs, found.without, estimate, ground_truth));
  const Similarity fit = AlignRobustly(pairs, options.fit_scale);
  const double median_m = QuantileOf(DistancesOf(fit, pairs), 0.5);
  RIGCAL_RETURN_IF_ERROR(ExplainMisfit(pairs, options.fit_scale, median_m, &result.notes));
  const double extent_m = ExtentOf(pairs);
  const std::string rate =
      ExplainRate(estimate, ground_truth, options, result.time_offset_s, fit, pairs);
  if (!rate.empty() && median_m > kNoFit * extent_m) return absl::InvalidArgumentError(rate);
  if (!rate.empty()) result.notes.push_back(rate);
  NoteLongSpacing(estimate, "estimate", &result.notes);
  NoteLongSpacing(ground_truth, "ground truth", &result.notes);
  if (median_m > kNoFit * extent_m) {
    const std::string why = absl::StrCat("the median error is ", FormatFixed(median_m, 3),
                                         " m, of positions that are ", FormatFixed(extent_m, 3),
                                         " m from their middle: these do not show the same motion");
    if (options.fit_time) {
      return absl::InvalidArgumentError(
          absl::StrCat("no time offset fits: ", why, "; check the files and their labels"));
    }
    result.notes.push_back(why);
  }
  result.scale = fit.scale;
  result.truth_from_estimate = RigidTransform(Eigen::Quaterniond(fit.rotation), fit.translation_m);
  for (const PositionPair& pair : pairs) {
    result.errors.push_back({pair.time_s, *pair.label, fit.ErrorOf(pair)});
  }
  std::stable_sort(result.errors.begin(), result.errors.end(),
                   [](const auto& a, const auto& b) { return a.time_s < b.time_s; });
  FillStatistics(&result);
  NoteTimes(match, match.interpolates_truth() ? ground_truth : estimate, &result);
  return result;
}

}  // namespace rigcal::client
