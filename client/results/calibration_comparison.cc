// SPDX-License-Identifier: Apache-2.0
#include "client/results/calibration_comparison.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/results/calibration_export.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"

namespace rigcal::client {
namespace {

absl::Status CheckComparable(const v1::Calibration& calibration) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(calibration));
  if (calibration.scale_known()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("calibration ", calibration.id(),
                   " has no metric scale, so its positions cannot be compared"));
}

// What was imported has none.
double MeanResidualPx(const v1::CalibratedCamera& camera) {
  return camera.has_residuals() ? camera.residuals().all().mean_px() : std::nan("");
}

// Most other programs' files have none.
double TimeOffsetS(const v1::CalibratedCamera& camera) {
  const bool unknown = !camera.has_residuals() && camera.time_offset_s() == 0;
  return unknown ? std::nan("") : camera.time_offset_s();
}

std::string FormatKnown(double value) {
  return std::isnan(value) ? std::string("-") : FormatFixed(value, 3);
}

std::string NamesOf(const v1::Calibration& calibration) {
  return absl::StrJoin(calibration.cameras(), ", ",
                       [](std::string* out, const v1::CalibratedCamera& camera) {
                         absl::StrAppend(out, camera.camera());
                       });
}

std::map<std::string, const v1::CalibratedCamera*> ByName(const v1::Calibration& calibration) {
  std::map<std::string, const v1::CalibratedCamera*> cameras;
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    cameras.emplace(camera.camera(), &camera);
  }
  return cameras;
}

}  // namespace

absl::StatusOr<CalibrationComparison> Compare(const v1::Calibration& a, const v1::Calibration& b) {
  RIGCAL_RETURN_IF_ERROR(CheckComparable(a));
  RIGCAL_RETURN_IF_ERROR(CheckComparable(b));
  CalibrationComparison comparison;
  comparison.id_a = a.id();
  comparison.id_b = b.id();
  comparison.same_observations =
      !a.observation_digest().empty() && a.observation_digest() == b.observation_digest();

  std::vector<PosePair> poses;
  const auto cameras_b = ByName(b);
  const auto cameras_a = ByName(a);
  for (const auto& [name, camera_a] : cameras_a) {
    const auto found = cameras_b.find(name);
    if (found == cameras_b.end()) {
      comparison.only_in_a.push_back(name);
      continue;
    }
    const v1::CalibratedCamera* camera_b = found->second;
    PosePair& pair = poses.emplace_back();
    RIGCAL_ASSIGN_OR_RETURN(pair.cam_from_a, wire::FromProto(camera_a->cam_from_rig()));
    RIGCAL_ASSIGN_OR_RETURN(pair.cam_from_b, wire::FromProto(camera_b->cam_from_rig()));
    comparison.cameras.push_back(
        {.camera = name,
         .time_offset_difference_s = TimeOffsetS(*camera_b) - TimeOffsetS(*camera_a),
         .mean_px_a = MeanResidualPx(*camera_a),
         .mean_px_b = MeanResidualPx(*camera_b)});
  }
  for (const auto& [name, camera] : cameras_b) {
    if (!cameras_a.contains(name)) comparison.only_in_b.push_back(name);
  }
  if (poses.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("calibrations ", a.id(), " and ", b.id(),
                                                   " have no camera in common: A has ", NamesOf(a),
                                                   "; B has ", NamesOf(b)));
  }

  RIGCAL_ASSIGN_OR_RETURN(const RigidTransform b_from_a, AlignRigidly(poses));
  PoseDifference& most = comparison.max_difference;
  for (size_t i = 0; i < poses.size(); ++i) {
    const PoseDifference difference = DifferenceAfter(b_from_a, poses[i]);
    comparison.cameras[i].difference = difference;
    most.position_m = std::max(most.position_m, difference.position_m);
    most.rotation_deg = std::max(most.rotation_deg, difference.rotation_deg);
  }
  return comparison;
}

std::string FormatComparison(const CalibrationComparison& comparison) {
  TextTable table;
  table.Words({"camera"})
      .Numbers({"position (mm)", "rotation (deg)", "time offset (ms)"}, "difference, B to A")
      .Numbers({"A", "B"}, "mean residual, outliers included (px)");
  for (const CalibrationComparison::Camera& camera : comparison.cameras) {
    table.AddRow({camera.camera, FormatFixed(camera.difference.position_m * 1000, 3),
                  FormatFixed(camera.difference.rotation_deg, 4),
                  FormatKnown(camera.time_offset_difference_s * 1000),
                  FormatKnown(camera.mean_px_a), FormatKnown(camera.mean_px_b)});
  }
  table.AddRow({"largest", FormatFixed(comparison.max_difference.position_m * 1000, 3),
                FormatFixed(comparison.max_difference.rotation_deg, 4)});
  std::string text =
      absl::StrCat("A  ", comparison.id_a, "\nB  ", comparison.id_b,
                   comparison.same_observations ? " (from the same observations and options)" : "",
                   "\n\nAfter the best rigid alignment of the camera positions\n");
  text += table.Format(2);
  for (const auto& [name, cameras] :
       {std::pair("A", &comparison.only_in_a), std::pair("B", &comparison.only_in_b)}) {
    if (cameras->empty()) continue;
    absl::StrAppend(&text, "only in ", name, ": ", absl::StrJoin(*cameras, ", "), "\n");
  }
  return Printable(text);
}

std::string ToJson(const CalibrationComparison& comparison) {
  using Json = nlohmann::ordered_json;
  Json cameras = Json::array();
  for (const CalibrationComparison::Camera& camera : comparison.cameras) {
    cameras.push_back({{"camera", camera.camera},
                       {"position_difference_m", camera.difference.position_m},
                       {"rotation_difference_deg", camera.difference.rotation_deg},
                       {"time_offset_difference_s", camera.time_offset_difference_s},
                       {"mean_px_a", camera.mean_px_a},
                       {"mean_px_b", camera.mean_px_b}});
  }
  const Json json = {{"a", comparison.id_a},
                     {"b", comparison.id_b},
                     {"cameras", cameras},
                     {"only_in_a", comparison.only_in_a},
                     {"only_in_b", comparison.only_in_b},
                     {"max_position_difference_m", comparison.max_difference.position_m},
                     {"max_rotation_difference_deg", comparison.max_difference.rotation_deg},
                     {"same_observations", comparison.same_observations}};
  return JsonText(json);
}

}  // namespace rigcal::client
