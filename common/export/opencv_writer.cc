// SPDX-License-Identifier: Apache-2.0
// OpenCV FileStorage YAML, one file per camera. Units, axes and pixel origin are OpenCV's own.
#include "common/camera/camera_export.h"
#include "common/export/camera_file_names.h"
#include "common/export/format_writers.h"
#include "common/status/status_macros.h"

namespace rigcal {

ExportFiles WriteOpenCvYaml(const ExportedRig& rig) {
  std::vector<ExportFile> files;
  const std::vector<std::string> names = CameraFileNames(rig);
  for (const ExportedCamera& camera : rig.cameras) {
    CameraExport values;
    values.camera = camera.name;
    values.image_size_px = camera.image_size_px;
    values.intrinsics = camera.intrinsics;
    values.cam_from_rig = rig.has_poses ? std::optional(camera.cam_from_rig) : std::nullopt;
    values.reprojection_error_px = camera.mean_error_px;
    values.line_delay_s = camera.line_delay_s;
    RIGCAL_ASSIGN_OR_RETURN(std::string text, CameraExportText(values));
    files.push_back({names[files.size()] + ".yaml", std::move(text)});
  }
  return files;
}

}  // namespace rigcal
