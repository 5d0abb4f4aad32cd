// SPDX-License-Identifier: Apache-2.0
#include "common/export/rig_model.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/export/calibration_export.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/wire/camera_wire.h"

namespace rigcal {
namespace {

absl::Status CheckValues(const ExportedCamera& camera) {
  FaultList faults;
  faults.Add(camera.image_size_px.Validate());
  faults.Add(camera.intrinsics.Validate(camera.image_size_px));
  if (!camera.cam_from_rig.Matrix().allFinite()) faults.Add("its pose is not finite");
  for (const ClockCoursePoint& point : camera.clock_course) {
    if (!std::isfinite(point.offset_s)) faults.Add("its clock's course is not finite");
  }
  const double sum = camera.time_offset_s + camera.time_rate_ppm + camera.time_epoch_s +
                     camera.line_delay_s + camera.mean_error_px;
  if (!std::isfinite(sum)) faults.Add("its clock, line delay or error is not finite");
  return faults.Result();
}

absl::StatusOr<ExportedCamera> CameraOf(const v1::CalibratedCamera& proto, bool has_pose) {
  // The name becomes a file name.
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera name", proto.camera()));
  ExportedCamera camera;
  camera.name = proto.camera();
  camera.image_size_px = wire::FromProto(proto.image_size_px());
  RIGCAL_ASSIGN_OR_RETURN(camera.intrinsics, wire::FromProto(proto.intrinsics()));
  if (has_pose) {
    RIGCAL_ASSIGN_OR_RETURN(camera.cam_from_rig, wire::FromProto(proto.cam_from_rig()));
  }
  camera.time_offset_s = proto.time_offset_s();
  camera.time_rate_ppm = proto.time_rate_ppm();
  camera.time_epoch_s = proto.time_epoch_s();
  for (const v1::ClockCoursePoint& point : proto.clock_course()) {
    camera.clock_course.push_back({point.camera_time_ns(), point.offset_s()});
  }
  camera.line_delay_s = proto.line_delay_s();
  camera.mean_error_px = proto.residuals().inlier().mean_px();
  if (proto.has_uncertainty()) {
    const v1::CameraUncertainty& sigma = proto.uncertainty();
    camera.sigma =
        ExportedSigma{wire::FromProto(sigma.rotation_sigma_rad()),
                      wire::FromProto(sigma.position_sigma_m()),
                      {sigma.intrinsics_sigma().begin(), sigma.intrinsics_sigma().end()}};
  }
  RIGCAL_RETURN_IF_ERROR(CheckValues(camera));
  return camera;
}

}  // namespace

std::vector<double> ExportedCamera::Coefficients() const {
  std::vector<double> values = intrinsics.distortion;
  values.resize(static_cast<size_t>(CoefficientCount(intrinsics.model)), 0.0);
  return values;
}

bool ExportedCamera::HasDistortion() const {
  if (intrinsics.model == DistortionModel::kFisheye) return true;
  return std::any_of(intrinsics.distortion.begin(), intrinsics.distortion.end(),
                     [](double value) { return value != 0; });
}

absl::StatusOr<UpAxis> ParseUpAxis(std::string_view text) {
  if (text == "y") return UpAxis::kY;
  if (text == "z") return UpAxis::kZ;
  return absl::InvalidArgumentError("must be y or z");
}

absl::StatusOr<ExportedRig> RigOf(const v1::Calibration& calibration) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(calibration));
  if (!calibration.scale_known()) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", calibration.id(),
                     " has no metric scale, which this format promises; use the format json"));
  }
  ExportedRig rig;
  rig.calibration_id = calibration.id();
  const auto& created = calibration.run().create_time();
  rig.create_utc_ns = created.seconds() * 1'000'000'000 + created.nanos();
  rig.scale_sigma_rel = calibration.target().scale_sigma_rel();
  rig.has_poses =
      calibration.cameras().empty() ||
      std::any_of(calibration.cameras().begin(), calibration.cameras().end(),
                  [](const v1::CalibratedCamera& camera) { return camera.has_cam_from_rig(); });
  for (const v1::CalibratedCamera& proto : calibration.cameras()) {
    absl::StatusOr<ExportedCamera> camera = CameraOf(proto, rig.has_poses);
    if (!camera.ok()) {
      return absl::DataLossError(
          absl::StrCat("camera ", proto.camera(), " of calibration ", calibration.id(),
                       " cannot be exported: ", std::string(camera.status().message())));
    }
    rig.cameras.push_back(*std::move(camera));
  }
  return rig;
}

absl::Status CannotHold(const ExportedCamera& camera, const std::string& why) {
  return absl::FailedPreconditionError(absl::StrCat("camera ", camera.name, ": ", why));
}

double SingleFocalErrorPx(const ExportedCamera& camera) {
  const Intrinsics& k = camera.intrinsics;
  const double half = std::abs(k.fx_px - k.fy_px) / 2;
  double worst = 0;
  for (const double u : {-0.5, camera.image_size_px.width - 0.5}) {
    for (const double v : {-0.5, camera.image_size_px.height - 0.5}) {
      worst = std::max(worst, half * std::hypot((u - k.cx_px) / k.fx_px, (v - k.cy_px) / k.fy_px));
    }
  }
  return worst;
}

}  // namespace rigcal
