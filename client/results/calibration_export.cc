// SPDX-License-Identifier: Apache-2.0
#include "client/results/calibration_export.h"

#include <system_error>

#include "absl/strings/str_cat.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/results/ground_truth_comparison.h"
#include "common/camera/intrinsics_file.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/wire/camera_wire.h"

namespace rigcal::client {
namespace {

absl::Status MakeDirectory(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || !std::filesystem::is_directory(directory, error)) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot make the folder ", directory.string(), ": ",
                     error ? error.message() : "there is something else of that name"));
  }
  return absl::OkStatus();
}

absl::StatusOr<CameraExport> ToExport(const v1::CalibratedCamera& camera) {
  // The name becomes a file name.
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera name", camera.camera()));
  CameraExport result;
  result.camera = camera.camera();
  result.image_size_px = wire::FromProto(camera.image_size_px());
  RIGCAL_ASSIGN_OR_RETURN(result.intrinsics, wire::FromProto(camera.intrinsics()));
  RIGCAL_ASSIGN_OR_RETURN(result.cam_from_rig, wire::FromProto(camera.cam_from_rig()));
  result.reprojection_error_px = camera.residuals().all().mean_px();
  return result;
}

}  // namespace

absl::Status CheckHasResult(const v1::Calibration& calibration) {
  if (calibration.state() == v1::Calibration::STATE_SUCCEEDED) return absl::OkStatus();
  std::string message = absl::StrCat("calibration ", calibration.id(), " has no result: it is ",
                                     EnumWord(calibration.state()));
  if (!calibration.error().empty()) absl::StrAppend(&message, " (", calibration.error(), ")");
  return absl::FailedPreconditionError(message);
}

absl::StatusOr<std::vector<std::filesystem::path>> ExportOpenCv(
    const v1::Calibration& calibration, const std::filesystem::path& directory) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(calibration));
  if (!calibration.scale_known()) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", calibration.id(),
                     " has no metric scale, which this format promises; use --format json"));
  }
  std::vector<CameraExport> cameras;
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    absl::StatusOr<CameraExport> one = ToExport(camera);
    if (!one.ok()) {
      return absl::DataLossError(
          absl::StrCat("camera ", camera.camera(), " of calibration ", calibration.id(),
                       " cannot be exported: ", std::string(one.status().message())));
    }
    cameras.push_back(*std::move(one));
  }
  RIGCAL_RETURN_IF_ERROR(MakeDirectory(directory));
  std::vector<std::filesystem::path> files;
  for (const CameraExport& camera : cameras) {
    files.push_back(directory / (camera.camera + ".yaml"));
    RIGCAL_RETURN_IF_ERROR(WriteCameraExport(files.back().string(), camera));
  }
  return files;
}

absl::StatusOr<std::vector<std::filesystem::path>> ExportJson(
    const v1::Calibration& calibration, const std::filesystem::path& directory,
    const GroundTruthComparison* ground_truth) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(calibration));
  RIGCAL_RETURN_IF_ERROR(MakeDirectory(directory));
  const std::filesystem::path file = directory / "calibration.json";
  RIGCAL_RETURN_IF_ERROR(ReplaceFile(file, CalibrationJson(calibration, ground_truth) + "\n"));
  return std::vector<std::filesystem::path>{file};
}

std::span<const ExportFormat> ExportFormats() {
  static constexpr ExportFormat kFormats[] = {
      {"opencv",
       "one FileStorage YAML per camera (camera_matrix, distortion_coefficients, extrinsics: "
       "cam_from_rig 4x4 in metres, reprojection_error)",
       ExportOpenCv},
      {"json", "the whole calibration",
       [](const v1::Calibration& calibration, const std::filesystem::path& directory) {
         return ExportJson(calibration, directory);
       }},
  };
  return kFormats;
}

}  // namespace rigcal::client
