// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/calibration/calibration_frame.h"
#include "common/calibration/frame_options.h"
#include "common/calibration/parameter_information.h"
#include "rigcal/v1/frame.pb.h"
#include "rigcal/v1/information.pb.h"

namespace rigcal::wire {

v1::OriginOptions ToProto(const OriginRequest& request);
v1::ScaleOptions ToProto(const ScaleRequest& request);
// INVALID_ARGUMENT: an unknown source, a transform without a rotation. What else is wrong is for
// Validate().
absl::StatusOr<OriginRequest> FromProto(const v1::OriginOptions& proto);
ScaleRequest FromProto(const v1::ScaleOptions& proto);

v1::CalibrationFrame ToProto(const CalibrationFrame& frame);
v1::CalibrationScale ToProto(const CalibrationScale& scale);
absl::StatusOr<CalibrationFrame> FromProto(const v1::CalibrationFrame& proto);
CalibrationScale FromProto(const v1::CalibrationScale& proto);

v1::CalibrationInformation ToProto(const CalibrationInformation& information);
CalibrationInformation FromProto(const v1::CalibrationInformation& proto);

}  // namespace rigcal::wire
