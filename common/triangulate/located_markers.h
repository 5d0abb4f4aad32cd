// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/calibration/frame_options.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal {

// A measured marker in the frame of a calibration.
struct LocatedMarker {
  int marker = 0, place = 0;
  int64_t rig_time_ns = 0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d noise_m2 = Eigen::Matrix3d::Zero();  // by the noise of the centres
  Eigen::Matrix3Xd gain;  // by the calibration's parameters (PointGain); no columns: none are known
  std::vector<PixelView> views;
};

// Triangulates each by itself, in their order; those whose rays have no point are left out.
// INVALID_ARGUMENT: a camera that the calibration does not have.
absl::StatusOr<std::vector<LocatedMarker>> LocateMarkers(const CalibrationResult& calibration,
                                                         const std::vector<MarkerViews>& measured);

// As points of a triangulation, sorted by time, then marker.
Triangulation AsTriangulation(const std::vector<LocatedMarker>& markers);

// The views by the names of their cameras.
std::vector<MarkerView> NamedViews(const CalibrationResult& calibration,
                                   const std::vector<PixelView>& views);

}  // namespace rigcal
