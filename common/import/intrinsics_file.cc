// SPDX-License-Identifier: Apache-2.0
#include "common/import/intrinsics_file.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/import/import_readers.h"
#include "common/status/status_macros.h"

namespace rigcal {

absl::StatusOr<IntrinsicsFile> ReadIntrinsicsFile(const std::string& path,
                                                  const std::string& camera) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    return absl::NotFoundError(absl::StrCat(path, ": no such calibration file"));
  }
  if (!std::filesystem::is_regular_file(path, error)) {
    return ImportError(path, 0, "is not a file; name the camera's calibration file");
  }
  RIGCAL_ASSIGN_OR_RETURN(const ImportedRig rig, ReadCalibrationFile(path));
  const auto lens_of = [](const ImportedCamera& found) {
    return IntrinsicsFile{found.image_size_px, found.intrinsics};
  };
  if (rig.cameras.size() == 1 && rig.left_out.empty()) return lens_of(rig.cameras.front());
  const std::string stem = std::filesystem::path(path).stem().string();
  const std::string& name = camera.empty() ? stem : camera;
  for (const LeftOutCamera& left_out : rig.left_out) {
    if (left_out.name == name) return absl::InvalidArgumentError(left_out.why);
  }
  std::vector<std::string> names;
  for (const ImportedCamera& found : rig.cameras) {
    if (found.name == name || found.other_name == name) return lens_of(found);
    names.push_back(found.name);
  }
  return ImportError(path, 0,
                     absl::StrCat("has several cameras (", absl::StrJoin(names, ", "),
                                  "), and none is called ", name,
                                  "; call the camera like one of them, or write a file for each "
                                  "(rigcal calibration import ",
                                  path, " --output DIR)"));
}

std::string LensFileBeside(const std::string& recording) {
  const std::filesystem::path path(recording);
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  const std::string stem = path.stem().string();
  std::filesystem::path best = path;
  best.replace_extension(".yaml");
  std::error_code error;
  if (std::filesystem::exists(best, error)) return best.string();
  std::string best_name;  // the last one by the alphabet: .yml before .xml before .json
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::filesystem::path name = entry.path().filename();
    const std::string its_stem = name.stem().string();
    if (!IsLensFileName(name.string()) || (its_stem != stem && its_stem != stem + ".camera_info")) {
      continue;
    }
    if (best_name.empty() || name.string() > best_name) best_name = name.string();
  }
  return best_name.empty() ? best.string() : best.replace_filename(best_name).string();
}

bool IsLensFileName(const std::string& path) {
  const std::string end = absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  return end == ".yaml" || end == ".yml" || end == ".xml" || end == ".json" ||
         end == ".cameramodel";
}

}  // namespace rigcal
