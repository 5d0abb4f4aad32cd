// SPDX-License-Identifier: Apache-2.0
#include "client/results/ground_truth_comparison.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/results/calibration_export.h"
#include "client/results/true_point_error.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_result_wire.h"
#include "common/wire/camera_wire.h"

namespace rigcal::client {
namespace {

// rig time minus what the camera's clock shows, when it shows `time_s`.
double TrueOffset(const SimulatedCamera& camera, double time_s) {
  const double origin_s = static_cast<double>(camera.clock_origin_ns) * 1e-9;
  return camera.time_offset_s - origin_s + camera.time_rate_ppm * 1e-6 * (time_s - origin_s);
}

}  // namespace

absl::StatusOr<GroundTruthComparison> CompareWithGroundTruth(const v1::Calibration& calibration,
                                                             const SimulatedWorld& world) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(calibration));
  if (calibration.cameras().empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "calibration ", calibration.id(), " has no camera to compare with ground truth"));
  }
  std::vector<PosePair> poses;
  std::vector<double> estimated_offsets_s;
  std::vector<double> true_offsets_s;
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    const auto truth =
        std::ranges::find(world.cameras(), camera.camera(),
                          [](const SimulatedCamera& one) { return one.description.camera; });
    if (truth == world.cameras().end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("camera ", camera.camera(), " is not in the simulated rig"));
    }
    RIGCAL_ASSIGN_OR_RETURN(const RigidTransform cam_from_rig,
                            wire::FromProto(camera.cam_from_rig()));
    poses.push_back({cam_from_rig, truth->cam_from_rig});
    estimated_offsets_s.push_back(camera.time_offset_s());
    true_offsets_s.push_back(TrueOffset(*truth, camera.time_epoch_s()));
  }

  GroundTruthComparison comparison;
  if (!calibration.scale_known()) {
    RIGCAL_ASSIGN_OR_RETURN(comparison.unit_length_m, FindScale(poses));
    for (PosePair& pair : poses) pair.cam_from_a.translation_m *= comparison.unit_length_m;
  }
  RIGCAL_ASSIGN_OR_RETURN(const RigidTransform world_from_rig, AlignRigidly(poses));
  const double estimated_median_s = Median(estimated_offsets_s);
  const double true_median_s = Median(true_offsets_s);
  PoseDifference& most = comparison.max_error;
  for (size_t i = 0; i < poses.size(); ++i) {
    const PoseDifference error = DifferenceAfter(world_from_rig, poses[i]);
    comparison.cameras.push_back(
        {calibration.cameras(static_cast<int>(i)).camera(), error,
         (estimated_offsets_s[i] - estimated_median_s) - (true_offsets_s[i] - true_median_s)});
    most.position_m = std::max(most.position_m, error.position_m);
    most.rotation_deg = std::max(most.rotation_deg, error.rotation_deg);
  }
  // Poses alone can be compared, too.
  if (const auto result = wire::ResultFromProto(calibration); result.ok()) {
    comparison.point_error_m = TruePointErrorM(*result, world);
  }
  return comparison;
}

std::string FormatGroundTruthErrors(const GroundTruthComparison& comparison) {
  constexpr double kMmPerM = 1000;
  constexpr double kMsPerS = 1000;
  TextTable table;
  table.Words({"camera"}).Numbers({"position (mm)", "rotation (deg)", "time offset (ms)"}, "error");
  for (const GroundTruthComparison::Camera& camera : comparison.cameras) {
    table.AddRow({camera.camera, FormatFixed(camera.error.position_m * kMmPerM, 3),
                  FormatFixed(camera.error.rotation_deg, 4),
                  FormatFixed(camera.time_offset_error_s * kMsPerS, 3)});
  }
  table.AddRow({"largest", FormatFixed(comparison.max_error.position_m * kMmPerM, 3),
                FormatFixed(comparison.max_error.rotation_deg, 4)});
  std::string how = "rigid alignment of the camera positions";
  if (comparison.unit_length_m > 0) {
    how = absl::StrCat("the similarity that fits the camera positions best: the\n",
                       "scale is not known, and its unit taken as ",
                       FormatFixed(comparison.unit_length_m, 4), " m");
  }
  std::string points;
  if (comparison.point_error_m) {
    points = absl::StrCat("error of a point: ", FormatFixed(*comparison.point_error_m * kMmPerM, 2),
                          " mm or less in 95 % of the waved places (to compare with the expected "
                          "error)\n");
  }
  return absl::StrCat("\nErrors against ground truth, after ", how, "\n", table.Format(2), points);
}

std::string CalibrationJson(const v1::Calibration& calibration,
                            const GroundTruthComparison* comparison) {
  if (comparison == nullptr) return ToJson(calibration);
  using Json = nlohmann::ordered_json;
  Json cameras = Json::array();
  for (const GroundTruthComparison::Camera& camera : comparison->cameras) {
    cameras.push_back({{"camera", camera.camera},
                       {"position_error_m", camera.error.position_m},
                       {"rotation_error_deg", camera.error.rotation_deg},
                       {"time_offset_error_s", camera.time_offset_error_s}});
  }
  Json json = Json::parse(ToJson(calibration));
  Json truth = {{"cameras", cameras},
                {"max_position_error_m", comparison->max_error.position_m},
                {"max_rotation_error_deg", comparison->max_error.rotation_deg},
                {"unit_length_m", comparison->unit_length_m}};
  if (comparison->point_error_m) truth["point_error_m"] = *comparison->point_error_m;
  json["ground_truth"] = std::move(truth);
  return JsonText(json);
}

}  // namespace rigcal::client
