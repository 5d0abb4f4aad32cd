// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/calibration/calibration_record.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal::wire {

// Without the covariance of the cameras, residual vectors and attempts.
v1::Calibration ToProto(const Calibration& calibration);
// What a later version has added is taken for unknown, and options are not validated: whether they
// were allowed was decided when the calibration was asked for. INVALID_ARGUMENT: it cannot be read.
absl::StatusOr<Calibration> FromProto(const v1::Calibration& proto);
// Of a request. INVALID_ARGUMENT: something in them is not known, or not allowed.
absl::StatusOr<CalibrationOptions> FromProto(const v1::CalibrationOptions& proto);
v1::CalibrationOptions ToProto(const CalibrationOptions& options);

// The store's form; bytes of equal calibrations are equal.
std::string SerializeCalibration(const Calibration& calibration);
absl::StatusOr<Calibration> ParseCalibration(std::string_view bytes);

}  // namespace rigcal::wire
