// SPDX-License-Identifier: Apache-2.0
// caliscope's camera_array.toml. Cameras are whole numbers there, counted from 0 in the order of
// their names; the field `name` is ours, and ignored by caliscope.
#include "absl/strings/str_cat.h"
#include "common/export/decimal_text.h"
#include "common/export/format_writers.h"
#include "common/export/toml_camera.h"

namespace rigcal {

ExportFiles WriteCaliscope(const ExportedRig& rig) {
  std::string text = absl::StrCat("# rigcal calibration ", rig.calibration_id, ", metres\n");
  size_t index = 0;
  for (const ExportedCamera& camera : rig.cameras) {
    absl::StrAppend(&text, "[cameras.", index, "]\ncam_id = ", index, "\nname = \"", camera.name,
                    "\"\nrotation_count = 0\nerror = ", DecimalText(camera.mean_error_px), "\n",
                    TomlCameraFields(camera), "\n");
    ++index;
  }
  return std::vector<ExportFile>{{"camera_array.toml", std::move(text)}};
}

}  // namespace rigcal
