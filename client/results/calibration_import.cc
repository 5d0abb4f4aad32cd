// SPDX-License-Identifier: Apache-2.0
#include "client/results/calibration_import.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/import/import_readers.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"

namespace rigcal::client {

absl::StatusOr<CalibrationImport> ImportCalibration(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(ImportedRig rig, ReadCalibrationFile(path));
  std::sort(rig.cameras.begin(), rig.cameras.end(),
            [](const ImportedCamera& a, const ImportedCamera& b) { return a.name < b.name; });
  CalibrationImport result;
  result.notes = std::move(rig.notes);
  v1::Calibration& calibration = result.calibration;
  calibration.set_id(path);
  calibration.set_state(v1::Calibration::STATE_SUCCEEDED);
  calibration.set_scale_known(true);
  for (const ImportedCamera& camera : rig.cameras) {
    if (!camera.cam_from_rig) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": has no pose of the camera ", camera.name));
    }
    v1::CalibratedCamera* const proto = calibration.add_cameras();
    proto->set_camera(camera.name);
    *proto->mutable_image_size_px() = wire::ToProto(camera.image_size_px);
    *proto->mutable_intrinsics() = wire::ToProto(camera.intrinsics);
    *proto->mutable_cam_from_rig() = wire::ToProto(*camera.cam_from_rig);
    proto->set_time_offset_s(camera.time_offset_s);
  }
  return result;
}

bool IsImportPath(const std::string& text) { return text.find_first_of("./") != std::string::npos; }

}  // namespace rigcal::client
