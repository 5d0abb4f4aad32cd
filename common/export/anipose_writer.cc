// SPDX-License-Identifier: Apache-2.0
// anipose's calibration.toml, as aniposelib's CameraGroup loads it.
#include "absl/strings/str_cat.h"
#include "common/export/decimal_text.h"
#include "common/export/format_writers.h"
#include "common/export/toml_camera.h"

namespace rigcal {

ExportFiles WriteAnipose(const ExportedRig& rig) {
  std::string text = absl::StrCat("# rigcal calibration ", rig.calibration_id, ", metres\n");
  double sum_px = 0;
  size_t index = 0;
  for (const ExportedCamera& camera : rig.cameras) {
    absl::StrAppend(&text, "[cam_", absl::Dec(index++, absl::kZeroPad4), "]\nname = \"",
                    camera.name, "\"\n", TomlCameraFields(camera), "\n");
    sum_px += camera.mean_error_px;
  }
  absl::StrAppend(&text, "[metadata]\nadjusted = true\nerror = ",
                  DecimalText(index > 0 ? sum_px / static_cast<double>(index) : 0), "\n");
  return std::vector<ExportFile>{{"calibration.toml", std::move(text)}};
}

}  // namespace rigcal
