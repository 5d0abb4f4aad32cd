// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/frame_options.h"
#include "common/scale/scale_fusion.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal {

// Of rows, the markers between which lengths are known, at the instants that show both: of each
// length at most `max_pairs` pairs, evenly chosen. Errors of TriangulateRows and
// CheckCamerasAgree.
absl::StatusOr<std::vector<MarkerViews>> MeasureForScale(const CalibrationResult& calibration,
                                                         const ScaleRequest& request,
                                                         const std::vector<CameraRows>& rows,
                                                         const TriangulationOptions& options,
                                                         size_t max_pairs);

// All sources of the request, the target of the calibration first, fused. What disagrees is counted
// in (DisagreementOf). INVALID_ARGUMENT: no such camera, or no such source to leave out.
// FAILED_PRECONDITION: the scale of the calibration is not known; markers that were not seen
// together.
absl::StatusOr<ScaleFusion> FuseSources(const CalibrationResult& calibration,
                                        const ScaleRequest& request,
                                        const std::vector<MarkerViews>& measured);

// Which source disagrees with the others, by how much, and what to do. Empty: none.
std::string DisagreementOf(const ScaleFusion& fusion);

// The calibration with that scale, and the report of it. `calibration_id`: its own.
CalibrationResult WithScale(const CalibrationResult& calibration, const std::string& calibration_id,
                            const ScaleFusion& fusion);

}  // namespace rigcal
