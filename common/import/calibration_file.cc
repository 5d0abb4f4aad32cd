// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/import/convention.h"
#include "common/import/import_readers.h"
#include "common/import/xml_document.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr size_t kMaxImportBytes = size_t{4} << 20;

absl::StatusOr<std::string> ReadImportText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::PermissionDeniedError(absl::StrCat(path, ": cannot open"));
  std::string text(kMaxImportBytes + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.bad()) return absl::DataLossError(absl::StrCat(path, ": cannot read"));
  text.resize(static_cast<size_t>(file.gcount()));
  if (text.size() <= kMaxImportBytes) return text;
  return ImportError(
      path, 0,
      absl::StrCat("is larger than ", kMaxImportBytes, " bytes, too large for a calibration"));
}

bool IsYamlName(const std::filesystem::path& path) {
  return path.extension() == ".yaml" || path.extension() == ".yml";
}

absl::StatusOr<ImportedRig> ReadOpenCvFiles(const std::string& path,
                                            std::vector<std::filesystem::path> files) {
  std::sort(files.begin(), files.end());
  ImportedRig rig{"OpenCV", {}, {}};
  for (const std::filesystem::path& file : files) {
    RIGCAL_ASSIGN_OR_RETURN(ImportedCamera camera, ReadOpenCvCamera(file.string()));
    rig.cameras.push_back(std::move(camera));
  }
  RIGCAL_RETURN_IF_ERROR(CheckNames(path, rig));
  RecogniseConvention(&rig);
  return rig;
}

absl::StatusOr<ImportedRig> ReadXmlRig(const std::string& path, const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const XmlDocument document, XmlDocument::Parse(path, text));
  const std::string root = document.root().name();
  if (root == "Cameras") return ReadVicon(path, text);
  if (root == "calibration") return ReadQtm(path, text);
  return ImportError(path, document.root().line(),
                     absl::StrCat("begins with <", root.substr(0, 64),
                                  ">, neither QTM's <calibration> nor Vicon's <Cameras>"));
}

}  // namespace

absl::StatusOr<ImportedRig> ReadCalibrationFile(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    return absl::NotFoundError(absl::StrCat(path, ": no such file or folder"));
  }
  if (std::filesystem::is_directory(path, error)) {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(path, error)) {
      if (entry.is_regular_file(error) && IsYamlName(entry.path())) files.push_back(entry.path());
    }
    if (files.empty()) return ImportError(path, 0, "is a folder without OpenCV files (*.yaml)");
    return ReadOpenCvFiles(path, files);
  }
  if (!std::filesystem::is_regular_file(path, error)) {
    return ImportError(path, 0, "is neither a file nor a folder");
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::string text, ReadImportText(path));
  absl::string_view begin = text;
  absl::ConsumePrefix(&begin, "\xef\xbb\xbf");
  begin = absl::StripLeadingAsciiWhitespace(begin);
  if (begin.empty()) return ImportError(path, 0, "is empty");
  if (absl::StartsWith(begin, "%YAML")) return ReadOpenCvFiles(path, {path});
  if (absl::StartsWith(begin, "<")) return ReadXmlRig(path, text);
  const std::filesystem::path name(path);
  if (name.extension() == ".toml") return ReadCaliscope(path, text);
  if (IsYamlName(name)) return ReadKalibr(path, text);
  return ImportError(path, 0,
                     "is of no format that can be read: OpenCV's or kalibr's .yaml, caliscope's or "
                     "anipose's .toml, QTM's .qca.txt, Vicon's .xcp");
}

}  // namespace rigcal
