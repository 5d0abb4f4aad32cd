// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/calibration/calibration_record.h"
#include "rigcal/v1/calibration.pb.h"
#include "rigcal/v1/residuals.pb.h"

namespace rigcal::wire {

// The fields of a calibration's message that only one that has succeeded has. Without the
// covariance of the cameras and the residual vectors.
void FillResult(const CalibrationResult& result, v1::Calibration* proto);
// INVALID_ARGUMENT names the field.
absl::StatusOr<CalibrationResult> ResultFromProto(const v1::Calibration& proto);

v1::CameraResiduals ToProto(const CameraResiduals& residuals);
// Of lists that differ in length, what all of them have.
CameraResiduals FromProto(const v1::CameraResiduals& proto);

}  // namespace rigcal::wire
