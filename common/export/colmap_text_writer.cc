// SPDX-License-Identifier: Apache-2.0
// A COLMAP model as text (COLMAP's documentation, "Output format"): one image per camera, without
// points. Poses are cam_from_world as a quaternion w x y z and a translation.
#include "absl/strings/str_cat.h"
#include "common/export/colmap_model.h"
#include "common/export/decimal_text.h"
#include "common/export/format_writers.h"

namespace rigcal {

ExportFiles WriteColmapText(const ExportedRig& rig) {
  const std::string origin =
      absl::StrCat("# rigcal calibration ", rig.calibration_id, ", metres\n");
  std::string cameras = origin + "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  std::string images = origin +
                       "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
                       "# POINTS2D[] as (X, Y, POINT3D_ID)\n";
  int id = 0;
  for (const ExportedCamera& camera : rig.cameras) {
    ++id;
    const ColmapLens lens = ColmapLensOf(camera);
    absl::StrAppend(&cameras, id, " ", lens.model, " ", camera.image_size_px.width, " ",
                    camera.image_size_px.height);
    for (const double parameter : lens.parameters) {
      absl::StrAppend(&cameras, " ", DecimalText(parameter));
    }
    cameras += "\n";
    const Eigen::Quaterniond q = Canonical(camera.cam_from_rig.rotation);
    const Eigen::Vector3d& t = camera.cam_from_rig.translation_m;
    absl::StrAppend(&images, id);
    for (const double value : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}) {
      absl::StrAppend(&images, " ", DecimalText(value));
    }
    absl::StrAppend(&images, " ", id, " ", ColmapImageOf(camera), "\n\n");
  }
  return std::vector<ExportFile>{{"cameras.txt", std::move(cameras)},
                                 {"images.txt", std::move(images)},
                                 {"points3D.txt", origin + "# no points\n"}};
}

}  // namespace rigcal
