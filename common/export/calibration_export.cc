// SPDX-License-Identifier: Apache-2.0
#include "common/export/calibration_export.h"

#include <google/protobuf/util/json_util.h>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/camera/camera_export.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/wire/camera_wire.h"

namespace rigcal {
namespace {

absl::StatusOr<CameraExport> ToExport(const v1::CalibratedCamera& camera) {
  // The name becomes a file name.
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera name", camera.camera()));
  CameraExport result;
  result.camera = camera.camera();
  result.image_size_px = wire::FromProto(camera.image_size_px());
  RIGCAL_ASSIGN_OR_RETURN(result.intrinsics, wire::FromProto(camera.intrinsics()));
  RIGCAL_ASSIGN_OR_RETURN(result.cam_from_rig, wire::FromProto(camera.cam_from_rig()));
  result.reprojection_error_px = camera.residuals().all().mean_px();
  if (camera.line_delay_sigma_s() > 0) result.line_delay_s = camera.line_delay_s();
  return result;
}

absl::StatusOr<ExportFile> OpenCvFile(const v1::CalibratedCamera& camera) {
  RIGCAL_ASSIGN_OR_RETURN(const CameraExport values, ToExport(camera));
  RIGCAL_ASSIGN_OR_RETURN(std::string text, CameraExportText(values));
  return ExportFile{camera.camera() + ".yaml", std::move(text)};
}

absl::StatusOr<std::vector<ExportFile>> MakeOpenCv(const v1::Calibration& calibration) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(calibration));
  if (!calibration.scale_known()) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", calibration.id(),
                     " has no metric scale, which this format promises; use the format json"));
  }
  std::vector<ExportFile> files;
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    absl::StatusOr<ExportFile> file = OpenCvFile(camera);
    if (!file.ok()) {
      return absl::DataLossError(
          absl::StrCat("camera ", camera.camera(), " of calibration ", calibration.id(),
                       " cannot be exported: ", std::string(file.status().message())));
    }
    files.push_back(*std::move(file));
  }
  return files;
}

absl::StatusOr<std::vector<ExportFile>> MakeJson(const v1::Calibration& calibration) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(calibration));
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string text;
  if (const auto status = google::protobuf::util::MessageToJsonString(calibration, &text, options);
      !status.ok()) {
    return absl::DataLossError(absl::StrCat("calibration ", calibration.id(),
                                            " cannot be written as JSON: ", status.ToString()));
  }
  if (!text.ends_with('\n')) text += '\n';
  return std::vector<ExportFile>{{"calibration.json", std::move(text)}};
}

constexpr CalibrationExportFormat kFormats[] = {
    {"opencv",
     "one FileStorage YAML per camera (camera_matrix, distortion_coefficients, extrinsics: "
     "cam_from_rig 4x4 in metres, reprojection_error; line_delay of a rolling shutter)",
     "application/yaml", &MakeOpenCv},
    {"json", "the whole calibration", "application/json", &MakeJson},
};

// "calibration.json" -> ".json"
std::string_view ExtensionOf(std::string_view name) {
  const size_t dot = name.rfind('.');
  return dot == std::string_view::npos ? std::string_view() : name.substr(dot);
}

}  // namespace

absl::Status CheckHasResult(const v1::Calibration& calibration) {
  if (calibration.state() == v1::Calibration::STATE_SUCCEEDED) return absl::OkStatus();
  const std::string& name = v1::Calibration::State_Name(calibration.state());
  std::string message = absl::StrCat("calibration ", calibration.id(), " has no result: it is ",
                                     absl::AsciiStrToLower(absl::StripPrefix(name, "STATE_")));
  if (!calibration.error().empty()) absl::StrAppend(&message, " (", calibration.error(), ")");
  return absl::FailedPreconditionError(message);
}

std::span<const CalibrationExportFormat> CalibrationExportFormats() { return kFormats; }

absl::StatusOr<const CalibrationExportFormat*> FindCalibrationExportFormat(std::string_view name) {
  std::string names;
  for (const CalibrationExportFormat& format : kFormats) {
    if (format.name == name) return &format;
    absl::StrAppend(&names, names.empty() ? "" : ", ", format.name);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("there is no such format of exports; the formats are: ", names));
}

absl::StatusOr<ExportDownload> MakeDownload(const CalibrationExportFormat& format,
                                            const v1::Calibration& calibration) {
  RIGCAL_ASSIGN_OR_RETURN(std::vector<ExportFile> files, format.make(calibration));
  const std::string base = absl::StrCat(calibration.id(), "-", format.name);
  if (files.size() == 1) {
    const std::string_view extension = ExtensionOf(files.front().name);
    return ExportDownload{base + std::string(extension), format.content_type,
                          std::move(files.front().content)};
  }
  RIGCAL_ASSIGN_OR_RETURN(std::string zip, ZipOf(files));
  return ExportDownload{base + ".zip", "application/zip", std::move(zip)};
}

}  // namespace rigcal
