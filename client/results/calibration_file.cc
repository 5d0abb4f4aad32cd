// SPDX-License-Identifier: Apache-2.0
#include "client/results/calibration_file.h"

#include <google/protobuf/util/json_util.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "client/output/output.h"
#include "client/results/calibration_import.h"
#include "common/export/calibration_export.h"
#include "common/export/covariance_json.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"
#include "common/wire/calibration_result_wire.h"

namespace rigcal::client {
namespace {

namespace fs = std::filesystem;

constexpr char kCovarianceField[] = "camera_covariance";

absl::Status NoCalibration(const std::string& what, const std::string& why) {
  return absl::InvalidArgumentError(
      absl::StrCat(what, " is not the JSON of a calibration (", why,
                   "); rigcal calibration export ID --format json writes one"));
}

absl::StatusOr<std::string> TextOf(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (stream) return text.str();
  return absl::NotFoundError(absl::StrCat("cannot read the calibration ", file.string()));
}

}  // namespace

absl::StatusOr<CalibrationFile> ParseCalibrationJson(const std::string& what,
                                                     const std::string& json) {
  CalibrationFile file;
  if (const auto line = LineNestedTooDeep(NestedFormat::kJson, json)) {
    return NoCalibration(what, absl::StrCat("line ", *line, " ", kNestedTooDeep));
  }
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  const auto parsed = google::protobuf::util::JsonStringToMessage(json, &file.calibration, options);
  if (!parsed.ok()) return NoCalibration(what, std::string(parsed.message()));
  if (file.calibration.cameras().empty()) return NoCalibration(what, "it has no cameras");
  if (file.calibration.state() == v1::Calibration::STATE_UNSPECIFIED) {
    return NoCalibration(what, "it has no field state");
  }
  const auto object = ParseJson<nlohmann::json>(json);
  if (!object.is_object() || !object.contains(kCovarianceField)) return file;
  for (const auto& value : object[kCovarianceField]) {
    if (!value.is_number()) return NoCalibration(what, "camera_covariance is no list of numbers");
    file.camera_covariance.push_back(value.get<double>());
  }
  return file;
}

std::string OwnCalibrationPath(const std::string& path) {
  fs::path file = path;
  std::error_code error;
  if (fs::is_directory(file, error)) file /= "calibration.json";
  if (!fs::is_regular_file(file, error) ||
      absl::AsciiStrToLower(file.extension().string()) != ".json") {
    return "";
  }
  // Of other programs, and of OpenCV, those that say so; what is no JSON at all is taken for ours,
  // so that the message says how ours looks.
  const auto text = TextOf(file);
  const auto json = text.ok() ? ParseJson<nlohmann::json>(*text) : nlohmann::json();
  const bool other = json.is_object() && !json.empty() &&
                     !(json.contains("cameras") && json["cameras"].is_array());
  return other ? "" : file.string();
}

absl::StatusOr<CalibrationFile> ReadCalibration(const std::string& path) {
  const std::string own = OwnCalibrationPath(path);
  if (own.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(CalibrationImport imported, ImportCalibration(path));
    RIGCAL_RETURN_IF_ERROR(CheckHasPoses(path, imported));
    std::vector<std::string> messages = imported.Messages();
    return CalibrationFile{std::move(imported.calibration), {}, std::move(messages)};
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::string text, TextOf(own));
  return ParseCalibrationJson(own, text);
}

std::string CalibrationText(const CalibrationFile& file) {
  return absl::StrCat(WithCameraCovariance(ToJson(file.calibration), file.camera_covariance), "\n");
}

absl::StatusOr<CalibrationResult> ResultOf(const CalibrationFile& file) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(file.calibration));
  RIGCAL_ASSIGN_OR_RETURN(CalibrationResult result, wire::ResultFromProto(file.calibration));
  result.camera_covariance = file.camera_covariance;
  return result;
}

void SetResult(const CalibrationResult& result, CalibrationFile* file) {
  v1::Calibration& calibration = file->calibration;
  calibration.clear_cameras();
  calibration.clear_target();
  calibration.clear_other_targets();
  calibration.clear_refused();
  calibration.clear_findings();
  calibration.clear_quality();
  calibration.clear_trajectory();
  calibration.clear_wand_volume();
  wire::FillResult(result, &calibration);
  file->camera_covariance = result.camera_covariance;
}

}  // namespace rigcal::client
