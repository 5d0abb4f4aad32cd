// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal {

// Whether each camera's rays meet those of the others. The points of the cameras that agree would
// hide one that was moved or exchanged.
//
// FAILED_PRECONDITION names the cameras of which most of the centres that others shared were left
// out, with the shares, or says that no two agree. A camera with fewer than 20 such centres is not judged.
absl::Status CheckCamerasAgree(const CalibrationResult& calibration,
                               const Triangulation& triangulation);

}  // namespace rigcal
