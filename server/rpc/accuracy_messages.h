// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/calibration/calibration_record.h"
#include "rigcal/v1/calibration_service.pb.h"

namespace rigcal::server {

// What GetAccuracy answers. Errors as there, but for NOT_FOUND.
absl::StatusOr<v1::GetAccuracyResponse> AccuracyOf(const Calibration& calibration,
                                                   const v1::GetAccuracyRequest& request);

}  // namespace rigcal::server
