// SPDX-License-Identifier: Apache-2.0
// Pose2Sim's calibration file: anipose's fields under the name that Pose2Sim looks for. It reads
// the sign of a fisheye lens and computes as if there were none.
#include "absl/strings/str_cat.h"
#include "common/export/format_writers.h"
#include "common/export/toml_camera.h"

namespace rigcal {

ExportFiles WritePose2Sim(const ExportedRig& rig) {
  std::string text = absl::StrCat("# rigcal calibration ", rig.calibration_id, ", metres\n");
  size_t index = 0;
  for (const ExportedCamera& camera : rig.cameras) {
    if (camera.intrinsics.model == DistortionModel::kFisheye) {
      return CannotHold(camera, "Pose2Sim has no fisheye lenses");
    }
    absl::StrAppend(&text, "[cam_", absl::Dec(index++, absl::kZeroPad4), "]\nname = \"",
                    camera.name, "\"\n", TomlCameraFields(camera), "\n");
  }
  text += "[metadata]\nadjusted = true\nerror = 0.0\n";
  return std::vector<ExportFile>{{"Calib_rigcal.toml", std::move(text)}};
}

}  // namespace rigcal
