// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal {

// Whether each camera's rays meet those of the others. The points of the cameras that agree would
// hide one that was moved, or two whose rows are each other's.
//
// FAILED_PRECONDITION names the cameras of which most of the centres that others shared were left
// out, with the shares, or says that no two agree; a camera with fewer than 20 such centres is not
// judged by its share. Two cameras are named, however few of their centres were left out, where
// these meet the others once they are taken for each other's.
absl::Status CheckCamerasAgree(const CalibrationResult& calibration,
                               const Triangulation& triangulation);

// Triangulation::left_out_rows for people: "60 of 150 rows of frame_1, ..."; empty: none.
// `rows`: as they were triangulated.
std::string DescribeLeftOut(const std::vector<CameraRows>& rows,
                            const std::map<std::string, uint32_t>& left_out_rows);

}  // namespace rigcal
