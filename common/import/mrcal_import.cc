// SPDX-License-Identifier: Apache-2.0
// mrcal's .cameramodel ("cameramodel" in mrcal's documentation): a dictionary of Python with
// lensmodel, intrinsics (fx fy cx cy and the coefficients, in OpenCV's order), imagersize, and the
// rotation vector and translation that take points of the reference frame to the camera's, metres.
#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <optional>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/import/import_readers.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr size_t kPinholeValues = 4;  // fx fy cx cy

struct MrcalLens {
  const char* name;
  DistortionModel model;
  size_t coefficients;
};
constexpr MrcalLens kMrcalLenses[] = {
    {"LENSMODEL_PINHOLE", DistortionModel::kBrownConrady, 0},
    {"LENSMODEL_OPENCV4", DistortionModel::kBrownConrady, 4},
    {"LENSMODEL_OPENCV5", DistortionModel::kBrownConrady, 5},
    {"LENSMODEL_OPENCV8", DistortionModel::kRational, 8},
};

// The data of mrcal's own solve, which may stand in the file, are no text that YAML could read.
std::string WithoutOptimization(std::string text) {
  const size_t key = text.find("'optimization_inputs'");
  if (key == std::string::npos) return text;
  const size_t open = text.find("b'", key);
  if (open == std::string::npos) return text;
  size_t close = open + 2;
  while (close < text.size() && text[close] != '\'') close += text[close] == '\\' ? 2 : 1;
  // As many lines as before, so that errors name the right one.
  for (size_t i = key; i < std::min(close + 1, text.size()); ++i) {
    if (text[i] != '\n') text[i] = ' ';
  }
  const size_t comma = text.find_first_not_of(" \n\r\t", key);
  if (comma != std::string::npos && text[comma] == ',') text[comma] = ' ';
  return text;
}

absl::StatusOr<std::vector<double>> MrcalNumbers(const std::string& path, const LensNode& root,
                                                 const char* name) {
  const LensNode* const node = root.Find(name);
  if (node == nullptr) return ImportError(path, root.line, absl::StrCat("has no ", name));
  std::vector<double> values;
  for (const LensNode& item : node->items) {
    double value = 0;
    if (!absl::SimpleAtod(item.text, &value)) {
      return ImportError(path, node->line, absl::StrCat(name, " is no list of numbers"));
    }
    values.push_back(value);
  }
  return values;
}

}  // namespace

absl::StatusOr<ImportedRig> ReadMrcal(const std::string& path, const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const LensNode root, LensTreeOfYaml(path, WithoutOptimization(text)));
  const LensNode* const model = root.Find("lensmodel");
  if (model == nullptr)
    return ImportError(path, root.line, "has no lensmodel, as mrcal's files do");
  const MrcalLens* lens = nullptr;
  for (const MrcalLens& known : kMrcalLenses) {
    if (model->text == known.name) lens = &known;
  }
  if (lens == nullptr) {
    const bool is_splined = absl::StartsWith(model->text, "LENSMODEL_SPLINED");
    return ImportError(
        path, model->line,
        absl::StrCat("the lens is ", model->text.substr(0, 64),
                     ", which rigcal does not have; mrcal-convert-lensmodel writes it as "
                     "LENSMODEL_OPENCV8",
                     is_splined ? ", which is less exact towards the border" : ""));
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> values, MrcalNumbers(path, root, "intrinsics"));
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> size, MrcalNumbers(path, root, "imagersize"));
  if (values.size() != kPinholeValues + lens->coefficients || size.size() != 2 || !(size[0] >= 1) ||
      !(size[1] >= 1) || size[0] > kMaxImageSidePx || size[1] > kMaxImageSidePx) {
    return ImportError(path, model->line,
                       absl::StrCat(lens->name, " has ", kPinholeValues + lens->coefficients,
                                    " intrinsics and a size of two numbers, the file ",
                                    values.size(), " and ", size.size()));
  }
  ImportedCamera camera;
  camera.name = std::filesystem::path(path).stem().string();
  camera.image_size_px = {static_cast<uint32_t>(size[0]), static_cast<uint32_t>(size[1])};
  camera.intrinsics.model = lens->model;
  camera.intrinsics.fx_px = values[0];
  camera.intrinsics.fy_px = values[1];
  camera.intrinsics.cx_px = values[2];
  camera.intrinsics.cy_px = values[3];
  camera.intrinsics.distortion.assign(values.begin() + kPinholeValues, values.end());
  if (lens->model == DistortionModel::kBrownConrady) camera.intrinsics.distortion.resize(5, 0.0);
  if (root.Find("extrinsics") != nullptr) {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> pose, MrcalNumbers(path, root, "extrinsics"));
    if (pose.size() != 6) {
      return ImportError(path, root.Find("extrinsics")->line,
                         absl::StrCat("extrinsics has ", pose.size(), " numbers, not 6"));
    }
    const Eigen::Vector3d turn(pose[0], pose[1], pose[2]);
    RigidTransform cam_from_rig;
    if (turn.norm() > 0) {
      cam_from_rig.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized());
    }
    cam_from_rig.translation_m = {pose[3], pose[4], pose[5]};
    camera.cam_from_rig = cam_from_rig;
  }
  RIGCAL_RETURN_IF_ERROR(CheckImported(path, model->line, camera));
  ImportedRig rig{"mrcal", {}, {}};
  rig.cameras.push_back(std::move(camera));
  return rig;
}

}  // namespace rigcal
