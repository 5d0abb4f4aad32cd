// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/accuracy_messages.h"

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "server/solve/evaluate/triangulation_accuracy.h"

namespace rigcal::server {
namespace {

void SetPoint(const PointAccuracy& point, v1::PointAccuracy* proto) {
  *proto->mutable_point_m() = wire::ToProto(point.point_m);
  proto->set_camera_count(point.camera_count);
  if (point.camera_count < 2) return;
  *proto->mutable_noise_sigma_m() = wire::ToProto(point.noise_sigma_m);
  *proto->mutable_shape_sigma_m() = wire::ToProto(point.shape_sigma_m);
  *proto->mutable_sigma_m() = wire::ToProto(point.sigma_m);
  proto->set_shape_total_m(point.shape_sigma_m.norm());
  proto->set_total_m(point.sigma_m.norm());
}

void SetSummary(const AccuracySummary& summary, v1::AccuracySummary* proto) {
  proto->set_count(summary.count);
  proto->set_median_m(summary.median_m);
  proto->set_p95_m(summary.p95_m);
  proto->set_worst_m(summary.worst_m);
  if (summary.count > 0) *proto->mutable_worst_point_m() = wire::ToProto(summary.worst_point_m);
}

}  // namespace

absl::StatusOr<v1::GetAccuracyResponse> AccuracyOf(const Calibration& calibration,
                                                   const v1::GetAccuracyRequest& request) {
  if (calibration.state != CalibrationState::kSucceeded || !calibration.result) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", calibration.id, " has no result",
                     calibration.state == CalibrationState::kFailed ? ": it failed" : " yet"));
  }
  AccuracyOptions options;
  options.grid_step_m = request.grid_step_m();
  if (request.sigma_px() != 0) options.sigma_px = request.sigma_px();
  for (const v1::Vector3& point : request.points_m()) {
    options.points_m.push_back(wire::FromProto(point));
  }
  RIGCAL_ASSIGN_OR_RETURN(const Accuracy accuracy, ComputeAccuracy(*calibration.result, options));
  v1::GetAccuracyResponse response;
  response.set_id(calibration.id);
  response.set_sigma_px(options.sigma_px);
  response.set_grid_step_m(accuracy.grid_step_m);
  response.set_scale_sigma_rel(accuracy.scale_sigma_rel);
  for (const PointAccuracy& point : accuracy.points) SetPoint(point, response.add_points());
  for (const PointAccuracy& point : accuracy.grid) SetPoint(point, response.add_grid());
  SetSummary(accuracy.shape, response.mutable_shape());
  SetSummary(accuracy.with_scale, response.mutable_with_scale());
  return response;
}

}  // namespace rigcal::server
