// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory_evaluation.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/results/trajectory_match.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

constexpr double kOnOneLine = 1e-4;  // second extent as a share of the first
// What another way to align must improve the median by, to be the explanation.
constexpr double kExplains = 5;
// A median error of this share of the motion is no fit at all.
constexpr double kNoFit = 0.25;

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
  const std::pair<double, const char*> units[] = {
      {1000, "millimetres"}, {100, "centimetres"}, {1 / 0.0254, "inches"}, {1 / 0.3048, "feet"}};
  for (const auto& [factor, unit] : units) {
    if (std::abs(scale / factor - 1) < 0.05) {
      return absl::StrCat("is the ground truth in ", unit, "? Give it in metres");
    }
    if (std::abs(scale * factor - 1) < 0.05) {
      return absl::StrCat("is the estimate in ", unit, "? Give it in metres");
    }
  }
  return "";
}

double MedianError(const std::vector<PositionPair>& pairs, bool with_scale, bool mirrored,
                   double* scale) {
  const Similarity fit = AlignRobustly(pairs, with_scale, mirrored);
  *scale = fit.scale;
  return QuantileOf(DistancesOf(fit, pairs), 0.5);
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
  if (error_m > 0.3 * result->median_m) {
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

nlohmann::ordered_json VectorJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

absl::StatusOr<TrajectoryEvaluation> EvaluateTrajectories(
    const Trajectories& estimate, const Trajectories& ground_truth,
    const TrajectoryEvaluationOptions& options) {
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
  std::string notes;
  for (const std::string& note : evaluation.notes) absl::StrAppend(&notes, "\nNote: ", note);
  if (!notes.empty()) notes += "\n";
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
      FormatFixed(evaluation.worst_m * kMm, 3), " mm\n", notes));
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
                   {"drift_m_per_s", VectorJson(evaluation.drift_m_per_s)},
                   {"notes", evaluation.notes}});
}

}  // namespace rigcal::client
