// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/results/trajectory_evaluation.h"

namespace rigcal::client {
namespace {

nlohmann::ordered_json VectorJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

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
