// SPDX-License-Identifier: Apache-2.0
// A Python script for Blender that adds the cameras to what is open. Cameras look along -z with y
// up; focal length and sensor are in millimetres of a sensor 36 mm wide, shifts in widths of the
// image, from its middle. Size of the image and shape of a pixel belong to a scene in Blender, so
// that every camera has one of its own, which shows the same objects.
#include "absl/strings/str_cat.h"
#include "common/export/decimal_text.h"
#include "common/export/format_writers.h"
#include "common/export/lens_shift.h"
#include "common/export/opengl_pose.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr double kSensorMm = 36;
constexpr double kMinLensMm = 1;  // of a Blender camera

constexpr char kBody[] = R"(
scene = bpy.context.scene
collection = bpy.data.collections.new("rigcal")
scene.collection.children.link(collection)
for entry in CAMERAS:
    data = bpy.data.cameras.new(entry["name"])
    data.type = "PERSP"
    data.lens_unit = "MILLIMETERS"
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = 36.0
    data.lens = entry["lens"]
    data.shift_x, data.shift_y = entry["shift"]
    camera = bpy.data.objects.new(entry["name"], data)
    camera["rigcal_name"] = entry["name"]
    camera.matrix_world = mathutils.Matrix(entry["matrix"])
    collection.objects.link(camera)
    view = bpy.data.scenes.new(entry["name"])
    view.collection.children.link(scene.collection)
    view.camera = camera
    view.render.resolution_x, view.render.resolution_y = entry["size"]
    view.render.resolution_percentage = 100
    view.render.pixel_aspect_x, view.render.pixel_aspect_y = entry["aspect"]
)";

// Blender's z axis points up.
Eigen::Matrix4d BlenderFromRig(UpAxis up) {
  Eigen::Matrix4d turn = Eigen::Matrix4d::Identity();
  if (up == UpAxis::kY) turn.topLeftCorner<3, 3>() << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return turn;
}

absl::StatusOr<std::string> EntryOf(const ExportedCamera& camera, UpAxis up) {
  RIGCAL_RETURN_IF_ERROR(CheckNoDistortion(camera, "Blender"));
  const Intrinsics& k = camera.intrinsics;
  const double width = camera.image_size_px.width, height = camera.image_size_px.height;
  const double lens_mm = k.fx_px * kSensorMm / width;
  if (lens_mm < kMinLensMm) {
    return CannotHold(camera, absl::StrCat("its focal length of ", k.fx_px,
                                           " px is less than Blender has for images ", width,
                                           " px wide (", width / kSensorMm, " px)"));
  }
  // How tall a pixel is for its width; Blender's numbers are at least 1.
  const double tall = k.fx_px / k.fy_px;
  const double aspect[] = {tall < 1 ? 1 / tall : 1, tall < 1 ? 1 : tall};
  const double shift[] = {(width / 2 - (k.cx_px + 0.5)) / width,
                          (k.cy_px + 0.5 - height / 2) * tall / width};
  const std::string lens_note =
      camera.refit_error_px > 0
          ? absl::StrCat("    # the lens is refitted: up to ", DecimalText(camera.refit_error_px),
                         " px off in the image\n")
          : "";
  const Eigen::Matrix4d pose = BlenderFromRig(up) * RigFromOpenGlCamera(camera);
  return absl::StrCat(lens_note, "    {\"name\": \"", camera.name, "\", \"size\": [", width, ", ",
                      height, "], \"lens\": ", DecimalText(lens_mm),
                      ", \"shift\": ", DecimalList(shift), ", \"aspect\": ", DecimalList(aspect),
                      ",\n     \"matrix\": ", DecimalMatrix<4, 4>(pose), "},\n");
}

}  // namespace

ExportFiles WriteBlender(const ExportedRig& rig) {
  std::string text = absl::StrCat("# rigcal calibration ", rig.calibration_id,
                                  ", metres. Run it in Blender: blender --python rig.py\n"
                                  "import bpy\nimport mathutils\n\nCAMERAS = [\n");
  for (const ExportedCamera& camera : rig.cameras) {
    RIGCAL_ASSIGN_OR_RETURN(const std::string entry, EntryOf(camera, rig.up));
    text += entry;
  }
  return std::vector<ExportFile>{{"rig.py", absl::StrCat(text, "]\n", kBody)}};
}

}  // namespace rigcal
