// SPDX-License-Identifier: Apache-2.0
#include "client/results/calibration_import.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "client/results/calibration_file.h"
#include "client/results/import_units.h"
#include "common/import/import_readers.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"

namespace rigcal::client {

absl::StatusOr<CalibrationImport> ImportCalibration(const std::string& path,
                                                    const std::string& units) {
  if (const std::string own = OwnCalibrationPath(path); !own.empty()) {
    if (!units.empty() && units != "m") {
      return absl::InvalidArgumentError(
          absl::StrCat(own,
                       ": is a calibration of rigcal, which has metres; leave --units out, or give "
                       "the file that it was made of"));
    }
    RIGCAL_ASSIGN_OR_RETURN(CalibrationFile file, ReadCalibration(own));
    return CalibrationImport{std::move(file.calibration), std::move(file.notes)};
  }
  RIGCAL_ASSIGN_OR_RETURN(ImportedRig rig, ReadCalibrationFile(path));
  if (const std::string doubt = ApplyUnits(path, units, &rig); !doubt.empty()) {
    rig.doubts.push_back(doubt);
  }
  std::sort(rig.cameras.begin(), rig.cameras.end(),
            [](const ImportedCamera& a, const ImportedCamera& b) { return a.name < b.name; });
  CalibrationImport result;
  result.notes = std::move(rig.notes);
  result.doubts = std::move(rig.doubts);
  for (const LeftOutCamera& camera : rig.left_out) {
    result.left_out.push_back(absl::StrCat("camera ", camera.name, " is left out: ", camera.why));
  }
  result.lenses_only = std::none_of(rig.cameras.begin(), rig.cameras.end(),
                                    [](const auto& camera) { return camera.cam_from_rig; });
  v1::Calibration& calibration = result.calibration;
  calibration.set_id(path);
  calibration.set_state(v1::Calibration::STATE_SUCCEEDED);
  calibration.set_scale_known(true);
  for (const ImportedCamera& camera : rig.cameras) {
    if (!camera.cam_from_rig && !result.lenses_only) {
      result.left_out.push_back(
          absl::StrCat("camera ", camera.name, " is left out: the file has no pose of it"));
      continue;
    }
    v1::CalibratedCamera* const proto = calibration.add_cameras();
    proto->set_camera(camera.name);
    *proto->mutable_image_size_px() = wire::ToProto(camera.image_size_px);
    *proto->mutable_intrinsics() = wire::ToProto(camera.intrinsics);
    if (camera.cam_from_rig) *proto->mutable_cam_from_rig() = wire::ToProto(*camera.cam_from_rig);
    proto->set_time_offset_s(camera.time_offset_s);
  }
  return result;
}

std::vector<std::string> CalibrationImport::Messages() const {
  std::vector<std::string> messages = notes;
  messages.insert(messages.end(), left_out.begin(), left_out.end());
  messages.insert(messages.end(), doubts.begin(), doubts.end());
  return messages;
}

absl::Status CheckHasPoses(const std::string& path, const CalibrationImport& imported) {
  if (!imported.lenses_only) return absl::OkStatus();
  std::string names;
  for (const v1::CalibratedCamera& camera : imported.calibration.cameras()) {
    absl::StrAppend(&names, names.empty() ? "" : ", ", camera.camera());
  }
  return absl::InvalidArgumentError(absl::StrCat(
      path, ": has the lens alone of ", names, "; a calibration has the pose of each camera, too"));
}

bool IsImportPath(const std::string& text) { return text.find_first_of("./") != std::string::npos; }

}  // namespace rigcal::client
