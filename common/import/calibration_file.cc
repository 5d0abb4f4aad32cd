// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/import/convention.h"
#include "common/import/import_readers.h"
#include "common/import/intrinsics_file.h"
#include "common/import/xml_document.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

namespace fs = std::filesystem;

constexpr char kReadableFormats[] =
    "OpenCV's .yaml, .xml or .json, ROS's camera_info, kalibr's .yaml, mrcal's .cameramodel, "
    "caliscope's, anipose's or "
    "Pose2Sim's .toml, QTM's .qca.txt, Vicon's .xcp, nerfstudio's transforms.json, OpenMVG's "
    "sfm_data.json, Basalt's calibration.json, the folder of a COLMAP model";

std::string LowerName(const fs::path& path) {
  return absl::AsciiStrToLower(path.filename().string());
}

bool IsLaunchFile(const fs::path& path) {
  const std::string name = LowerName(path);
  return absl::EndsWith(name, ".launch") || absl::EndsWith(name, ".launch.xml");
}

// kalibr's cam0, cam1, ... with fields of their own.
bool IsKalibr(const LensNode& root) {
  for (const auto& [key, value] : root.fields) {
    if (value.kind == LensNode::Kind::kMap && key.size() > 3 && absl::StartsWith(key, "cam") &&
        key.find_first_not_of("0123456789", 3) == std::string::npos) {
      return true;
    }
  }
  return false;
}

absl::StatusOr<ImportedRig> RigOfLens(const std::string& path, const LensNode& root) {
  ImportedRig rig{"OpenCV or ROS", {}, {}};
  RIGCAL_ASSIGN_OR_RETURN(rig.cameras.emplace_back(), LensCameraOf(path, root));
  return rig;
}

absl::StatusOr<ImportedRig> ReadYamlRig(const std::string& path, const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const LensNode root, LensTreeOfYaml(path, text));
  return IsKalibr(root) ? ReadKalibr(path, text) : RigOfLens(path, root);
}

absl::StatusOr<ImportedRig> ReadJsonRig(const std::string& path, const std::string& text) {
  const auto json = ParseJson<nlohmann::json>(text);
  if (json.is_object()) {
    if (json.contains("frames")) return ReadNerfstudio(path, text);
    if (json.contains("sfm_data_version")) return ReadOpenMvg(path, text);
    if (json.contains("value0")) return ReadBasalt(path, text);
    if (json.contains("cameras") && json["cameras"].is_object()) {
      return ImportError(path, 0,
                         absl::StrCat("has its cameras in a table by name, as Multical's "
                                      "calibration.json has; that is not read, but ",
                                      kReadableFormats, " are"));
    }
    if (json.contains("cameras")) {
      return ImportError(path, 0,
                         "is a whole calibration; rigcal calibration import writes files of its "
                         "lenses, which can be read here");
    }
  }
  return ReadYamlRig(path, text);
}

absl::StatusOr<ImportedRig> ReadXmlRig(const std::string& path, const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const XmlDocument document, XmlDocument::Parse(path, text));
  const std::string root = document.root().name();
  if (root == "Cameras") return ReadVicon(path, text);
  if (root == "calibration") return ReadQtm(path, text);
  if (root == "opencv_storage") return RigOfLens(path, LensTreeOfXml(document.root()));
  return ImportError(path, document.root().line(),
                     absl::StrCat("begins with <", root.substr(0, 64),
                                  ">, neither OpenCV's <opencv_storage>, QTM's <calibration> nor "
                                  "Vicon's <Cameras>"));
}

absl::StatusOr<ImportedRig> ReadFile(const std::string& path) {
  const std::string name = LowerName(path);
  RIGCAL_ASSIGN_OR_RETURN(const std::string text, ReadImportText(path));
  const absl::string_view begin = absl::StripLeadingAsciiWhitespace(text);
  if (begin.empty()) return ImportError(path, 0, "is empty");
  if (absl::StartsWith(begin, "\xff\xfe") || absl::StartsWith(begin, "\xfe\xff")) {
    return ImportError(path, 1, "is written as UTF-16; save it as UTF-8");
  }
  if (absl::EndsWith(name, ".cameramodel")) return ReadMrcal(path, text);
  if (absl::StartsWith(begin, "%YAML")) return ReadYamlRig(path, text);
  if (absl::StartsWith(begin, "<")) return ReadXmlRig(path, text);
  if (absl::StartsWith(begin, "{")) return ReadJsonRig(path, text);
  if (absl::EndsWith(name, ".toml")) return ReadCaliscope(path, text);
  if (IsLensFileName(path)) return ReadYamlRig(path, text);
  return ImportError(path, 0, absl::StrCat("is of no format that can be read: ", kReadableFormats));
}

// One file per camera, and the transforms of ROS beside them.
absl::StatusOr<ImportedRig> ReadLensFiles(const std::string& path,
                                          const std::vector<fs::path>& files,
                                          const std::vector<fs::path>& launch_files) {
  ImportedRig rig{"OpenCV or ROS", {}, {}};
  for (const fs::path& file : files) {
    absl::StatusOr<ImportedRig> one = ReadFile(file.string());
    if (one.ok() && one->cameras.size() != 1) {
      one = ImportError(file.string(), 0, "has several cameras; import it alone");
    }
    if (!one.ok()) {
      rig.Add(file.stem().string(), one.status());
      continue;
    }
    rig.cameras.push_back(std::move(one->cameras.front()));
  }
  for (const fs::path& file : launch_files) {
    RIGCAL_ASSIGN_OR_RETURN(const std::string text, ReadImportText(file.string()));
    RIGCAL_RETURN_IF_ERROR(AddRosTransforms(file.string(), text, &rig));
  }
  RIGCAL_RETURN_IF_ERROR(CheckNames(path, rig));
  RecogniseConvention(&rig);
  return rig;
}

absl::StatusOr<ImportedRig> ReadFolder(const std::string& path) {
  if (IsColmapFolder(path)) return ReadColmap(path);
  std::vector<fs::path> lenses, launch_files, others;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(path, error)) {
    const fs::path& file = entry.path();
    if (!entry.is_regular_file(error) || absl::StartsWith(file.filename().string(), ".")) continue;
    const std::string name = LowerName(file);
    if (IsLaunchFile(file)) {
      launch_files.push_back(file);
    } else if (IsLensFileName(file.string())) {
      lenses.push_back(file);
    } else if (absl::EndsWith(name, ".toml") || absl::EndsWith(name, ".xcp") ||
               absl::EndsWith(name, ".qca.txt")) {
      others.push_back(file);
    }
  }
  if (error) return ImportError(path, 0, "cannot be listed: " + error.message());
  std::sort(lenses.begin(), lenses.end());
  std::sort(launch_files.begin(), launch_files.end());
  if (lenses.empty() && others.size() == 1) return ReadFile(others.front().string());
  if (lenses.size() == 1 && launch_files.empty()) return ReadFile(lenses.front().string());
  if (!lenses.empty()) return ReadLensFiles(path, lenses, launch_files);
  return ImportError(path, 0,
                     absl::StrCat("is a folder without OpenCV files (*.yaml) or any other that can "
                                  "be read: ",
                                  kReadableFormats));
}

}  // namespace

absl::StatusOr<std::string> ReadImportText(const std::string& path, size_t most_bytes) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::PermissionDeniedError(absl::StrCat(path, ": cannot open"));
  std::string text(most_bytes + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.bad()) return absl::DataLossError(absl::StrCat(path, ": cannot read"));
  text.resize(static_cast<size_t>(file.gcount()));
  if (absl::StartsWith(text, "\xef\xbb\xbf")) text.erase(0, 3);
  if (text.size() <= most_bytes) return text;
  return ImportError(
      path, 0, absl::StrCat("is larger than ", most_bytes, " bytes, too large for a calibration"));
}

absl::StatusOr<ImportedRig> ReadCalibrationFile(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) {
    return absl::NotFoundError(absl::StrCat(path, ": no such file or folder"));
  }
  if (fs::is_directory(path, error)) return ReadFolder(path);
  if (!fs::is_regular_file(path, error)) {
    return ImportError(path, 0, "is neither a file nor a folder");
  }
  const std::string name = LowerName(path);
  if (name == "cameras.txt" || name == "images.txt" || name == "cameras.bin" ||
      name == "images.bin") {
    const fs::path folder = fs::path(path).parent_path();
    if (IsColmapFolder(folder.empty() ? "." : folder)) {
      return ReadColmap(folder.empty() ? "." : folder);
    }
  }
  RIGCAL_ASSIGN_OR_RETURN(ImportedRig rig, ReadFile(path));
  RIGCAL_RETURN_IF_ERROR(CheckNames(path, rig));
  return rig;
}

}  // namespace rigcal
