// SPDX-License-Identifier: Apache-2.0
#include "client/results/origin_report.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

constexpr size_t kMaxShown = 30;

std::string ThreeOf(const Eigen::Vector3d& values, int digits) {
  return absl::StrCat(FormatFixed(values.x(), digits), ", ", FormatFixed(values.y(), digits), ", ",
                      FormatFixed(values.z(), digits));
}

}  // namespace

std::string FormatOrigin(const OriginReport& report) {
  const OriginSolution& solution = report.solution;
  const RigidTransform& transform = solution.change.new_from_rig;
  const Eigen::Quaterniond rotation = Canonical(transform.rotation);
  std::string text = absl::StrCat(
      "Calibration ", Printable(report.calibration), " in its new frame, written to ",
      Printable(report.output), "\nnew_from_rig  ", ThreeOf(transform.translation_m, 6), " m; ",
      FormatFixed(rotation.w(), 8), ", ", ThreeOf(rotation.vec(), 8), " (w x y z)\n",
      "one sigma     axes ", ThreeOf(DegreesFromRadians(1) * solution.rotation_sigma_rad, 4),
      " degrees about x, y, z; origin ", ThreeOf(1000 * solution.position_sigma_m, 3), " mm\n",
      "lowest camera ", Printable(solution.lowest_camera),
      ", z = ", FormatFixed(solution.lowest_camera_m, 3), " m\n");
  if (solution.residuals.empty()) return text;
  absl::StrAppend(&text, "residuals     ", FormatFixed(1000 * solution.rms_m, 3), " mm rms\n");
  TextTable table;
  table.Words({"point"}).Numbers({"residual", "sigma"}, "mm");
  for (size_t i = 0; i < std::min(kMaxShown, solution.residuals.size()); ++i) {
    const OriginSolution::Residual& residual = solution.residuals[i];
    table.AddRow({Printable(residual.name), FormatFixed(1000 * residual.residual_m, 3),
                  FormatFixed(1000 * residual.sigma_m, 3)});
  }
  absl::StrAppend(&text, table.Format(2));
  if (solution.residuals.size() > kMaxShown) {
    absl::StrAppend(&text, "  and ", solution.residuals.size() - kMaxShown, " more\n");
  }
  return text;
}

std::string ToJson(const OriginReport& report) {
  const OriginSolution& solution = report.solution;
  const RigidTransform& transform = solution.change.new_from_rig;
  const Eigen::Quaterniond rotation = Canonical(transform.rotation);
  const auto list = [](const Eigen::Vector3d& v) {
    return nlohmann::ordered_json::array({v.x(), v.y(), v.z()});
  };
  nlohmann::ordered_json json = {
      {"calibration", report.calibration},
      {"output", report.output},
      {"new_from_rig",
       {{"rotation_wxyz", {rotation.w(), rotation.x(), rotation.y(), rotation.z()}},
        {"translation_m", list(transform.translation_m)}}},
      {"rotation_sigma_rad", list(solution.rotation_sigma_rad)},
      {"position_sigma_m", list(solution.position_sigma_m)},
      {"lowest_camera", solution.lowest_camera},
      {"lowest_camera_m", solution.lowest_camera_m},
      {"residual_rms_m", solution.rms_m},
      {"residuals", nlohmann::ordered_json::array()}};
  for (const OriginSolution::Residual& residual : solution.residuals) {
    json["residuals"].push_back({{"point", residual.name},
                                 {"residual_m", residual.residual_m},
                                 {"sigma_m", residual.sigma_m}});
  }
  return JsonText(json);
}

}  // namespace rigcal::client
