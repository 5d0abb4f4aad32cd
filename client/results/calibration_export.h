// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/statusor.h"
#include "common/export/calibration_export.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

struct GroundTruthComparison;

// Both write into `directory`, which is made where missing, and return the files written. Without
// `replace` nothing is written where there is a file of one of the names: ALREADY_EXISTS.
// FAILED_PRECONDITION: the calibration has no result, or the folder cannot be made; errors of the
// format.

absl::StatusOr<std::vector<std::filesystem::path>> WriteExport(
    const CalibrationExportFormat& format, const rigcal::v1::Calibration& calibration,
    const std::filesystem::path& directory, const ExportOptions& options = {},
    std::vector<LensNote>* notes = nullptr, bool replace = true);

// The calibration as `calibration.json`, with the covariance of its cameras (empty: none) and the
// comparison where there is one.
absl::StatusOr<std::vector<std::filesystem::path>> WriteJsonExport(
    const rigcal::v1::Calibration& calibration, const std::vector<double>& camera_covariance,
    const std::filesystem::path& directory, const GroundTruthComparison* ground_truth,
    bool replace = true);

}  // namespace rigcal::client
