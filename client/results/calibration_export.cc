// SPDX-License-Identifier: Apache-2.0
#include "client/results/calibration_export.h"

#include <system_error>

#include "absl/strings/str_cat.h"
#include "client/output/output.h"
#include "client/results/ground_truth_comparison.h"
#include "common/export/covariance_json.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"
#include "common/status/status_macros.h"

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

absl::StatusOr<std::vector<std::filesystem::path>> WriteFiles(
    const std::vector<ExportFile>& files, const std::filesystem::path& directory, bool replace) {
  std::vector<std::filesystem::path> paths;
  for (const ExportFile& file : files) {
    paths.push_back(directory / file.name);
    RIGCAL_RETURN_IF_ERROR(CheckMayWrite(paths.back(), replace));
  }
  RIGCAL_RETURN_IF_ERROR(MakeDirectory(directory));
  for (size_t i = 0; i < files.size(); ++i) {
    RIGCAL_RETURN_IF_ERROR(WriteOutputFile(paths[i], files[i].content));
  }
  return paths;
}

}  // namespace

absl::StatusOr<std::vector<std::filesystem::path>> WriteExport(
    const CalibrationExportFormat& format, const v1::Calibration& calibration,
    const std::filesystem::path& directory, const ExportOptions& options,
    std::vector<LensNote>* notes, bool replace) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<ExportFile> files,
                          format.make(calibration, options, notes));
  return WriteFiles(files, directory, replace);
}

absl::StatusOr<std::vector<std::filesystem::path>> WriteJsonExport(
    const v1::Calibration& calibration, const std::vector<double>& camera_covariance,
    const std::filesystem::path& directory, const GroundTruthComparison* ground_truth,
    bool replace) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(calibration));
  return WriteFiles(
      {{"calibration.json",
        WithCameraCovariance(CalibrationJson(calibration, ground_truth), camera_covariance) +
            "\n"}},
      directory, replace);
}

}  // namespace rigcal::client
