// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal::client {

// Triangulated points as frames of one rate, for formats of motion capture, which have no time for
// each point.
struct PointFrames {
  double rate_hz = 0;
  int64_t first_ns = 0;  // rig time of the first frame
  size_t frame_count = 0;
  std::vector<std::string> labels;
  // Frame by frame, in the order of `labels`; null: there is no point. They belong to the
  // triangulation.
  std::vector<const TriangulatedPoint*> points;
};

// The rate is that of the instants; where some are missing there are frames without points.
// FAILED_PRECONDITION: fewer than two instants; instants that are a quarter of a period or more
// away from every frame; a pause so long that the frames have more than 100 million places.
absl::StatusOr<PointFrames> FramesOf(const Triangulation& triangulation,
                                     const std::vector<std::string>& labels);

}  // namespace rigcal::client
