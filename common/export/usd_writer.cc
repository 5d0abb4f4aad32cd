// SPDX-License-Identifier: Apache-2.0
// USD as text (OpenUSD's documentation, UsdGeomCamera): a prim per camera, which looks along -z
// with y up. One unit is a metre; focal length and apertures are in tenths of a unit, of an image
// 36 mm wide. Matrices have the translation in their last row.
#include <cctype>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "common/export/decimal_text.h"
#include "common/export/format_writers.h"
#include "common/export/lens_shift.h"
#include "common/export/opengl_pose.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr double kApertureTenths = 0.36;

// Prims have names like variables, each its own.
std::string PrimName(const std::string& camera, std::set<std::string>* taken) {
  std::string name = camera;
  for (char& letter : name) {
    if (std::isalnum(static_cast<unsigned char>(letter)) == 0) letter = '_';
  }
  if (std::isdigit(static_cast<unsigned char>(name.front())) != 0) name.insert(0, "_");
  std::string own = name;
  for (int i = 2; !taken->insert(own).second; ++i) own = absl::StrCat(name, "_", i);
  return own;
}

std::string UsdPrim(const ExportedCamera& camera, const std::string& prim) {
  const Intrinsics& k = camera.intrinsics;
  const double width = camera.image_size_px.width, height = camera.image_size_px.height;
  const double across = kApertureTenths / width;  // of a pixel
  const double down = across * k.fx_px / k.fy_px;
  const Eigen::Matrix4d pose = RigFromOpenGlCamera(camera).transpose();
  const std::string matrix =
      absl::StrReplaceAll(DecimalMatrix<4, 4>(pose), {{"[", "("}, {"]", ")"}});
  return absl::StrCat(
      "    def Camera \"", prim, "\"\n    {\n", "        token projection = \"perspective\"\n",
      "        float focalLength = ", DecimalText(k.fx_px * across),
      "\n        float horizontalAperture = ", DecimalText(kApertureTenths),
      "\n        float verticalAperture = ", DecimalText(height * down),
      "\n        float horizontalApertureOffset = ",
      DecimalText((width / 2 - (k.cx_px + 0.5)) * across),
      "\n        float verticalApertureOffset = ", DecimalText((k.cy_px + 0.5 - height / 2) * down),
      "\n        float2 clippingRange = (0.01, 1000.0)\n",
      "        matrix4d xformOp:transform = ", matrix,
      "\n        uniform token[] xformOpOrder = [\"xformOp:transform\"]\n",
      camera.refit_error_px > 0 ? absl::StrCat("        custom double rigcal:lensErrorPx = ",
                                               DecimalText(camera.refit_error_px), "\n")
                                : std::string(),
      "        custom string rigcal:name = \"", camera.name, "\"\n",
      "        custom int2 rigcal:imageSize = (", width, ", ", height, ")\n    }\n");
}

}  // namespace

ExportFiles WriteUsd(const ExportedRig& rig) {
  std::string text =
      absl::StrCat("#usda 1.0\n(\n    defaultPrim = \"rig\"\n    doc = \"rigcal calibration ",
                   rig.calibration_id, "\"\n    metersPerUnit = 1\n    upAxis = \"",
                   rig.up == UpAxis::kZ ? "Z" : "Y",
                   "\"\n)\n\n"
                   "def Xform \"rig\"\n{\n");
  std::set<std::string> taken;
  for (const ExportedCamera& camera : rig.cameras) {
    RIGCAL_RETURN_IF_ERROR(CheckNoDistortion(camera, "USD"));
    text += UsdPrim(camera, PrimName(camera.name, &taken));
  }
  return std::vector<ExportFile>{{"rig.usda", text + "}\n"}};
}

}  // namespace rigcal
