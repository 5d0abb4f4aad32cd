// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal {

// Whether rows fit a calibration at all. Where most markers have no point because their cameras do
// not agree, the poses are taken for those of other conventions (the inverse transform, a camera
// that looks along -z with y up, both) and the rows are triangulated anew, thinned out.
//
// FAILED_PRECONDITION, with shares: another convention fits; none does, and then the rows are of
// other cameras, of a rig that was moved, or of clocks that were set anew.
absl::Status CheckConvention(const CalibrationResult& calibration,
                             const std::vector<CameraRows>& rows,
                             const TriangulationOptions& options,
                             const Triangulation& triangulation);

}  // namespace rigcal
