// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/frame_options.h"
#include "common/origin/origin.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal {

// Of rows, what a new frame is made from: of a path a part of its points, evenly chosen; else the
// markers at each place where the target rests.
// FAILED_PRECONDITION: it rests nowhere. Errors of TriangulateRows and CheckCamerasAgree.
// `left_out_rows`: by camera, those with centres that the others' rays missed; if not null.
absl::StatusOr<std::vector<MarkerViews>> MeasureForOrigin(
    const CalibrationResult& calibration, const OriginRequest& request,
    const std::vector<CameraRows>& rows, const TriangulationOptions& options,
    std::map<std::string, uint32_t>* left_out_rows = nullptr);

// The frame that `request` asks for, from `measured` where it is made from rows; named points
// without rows are static points of the calibration. `labels` of the markers: point m of the
// request is the marker with its label; empty, or without all of these labels: marker m. Points
// that nobody saw are appended to `unseen`, if not null. Errors of origin.h.
absl::StatusOr<OriginSolution> SolveOrigin(const CalibrationResult& calibration,
                                           const OriginRequest& request,
                                           const std::vector<MarkerViews>& measured,
                                           const std::vector<std::string>& labels = {},
                                           std::vector<std::string>* unseen = nullptr);

// The calibration in that frame, with the report of it. `calibration_id`: its own.
CalibrationResult WithOrigin(const CalibrationResult& calibration,
                             const std::string& calibration_id, FrameSource source,
                             const OriginSolution& solution);

}  // namespace rigcal
