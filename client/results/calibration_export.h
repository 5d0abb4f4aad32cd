// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

struct GroundTruthComparison;

// Both write into `directory`, which is made where missing, replace files of the same names, and
// return the files written. FAILED_PRECONDITION: the calibration has no result.

// OpenCV FileStorage, one `<camera>.yaml` per camera: camera_matrix, distortion_coefficients,
// extrinsics (4x4 cam_from_rig, metres), reprojection_error (mean, px). FAILED_PRECONDITION also
// where the scale is not known, for the file says metres.
absl::StatusOr<std::vector<std::filesystem::path>> ExportOpenCv(
    const rigcal::v1::Calibration& calibration, const std::filesystem::path& directory);

// The calibration as `calibration.json`, with the comparison where there is one.
absl::StatusOr<std::vector<std::filesystem::path>> ExportJson(
    const rigcal::v1::Calibration& calibration, const std::filesystem::path& directory,
    const GroundTruthComparison* ground_truth = nullptr);

// A format of `rigcal calibration export`. A new one is a row of the table in
// calibration_export.cc.
struct ExportFormat {
  const char* name;
  const char* help;  // what it writes
  absl::StatusOr<std::vector<std::filesystem::path>> (*write)(
      const rigcal::v1::Calibration& calibration, const std::filesystem::path& directory);
};
std::span<const ExportFormat> ExportFormats();

// FAILED_PRECONDITION unless it has succeeded.
absl::Status CheckHasResult(const rigcal::v1::Calibration& calibration);

}  // namespace rigcal::client
