// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/associate/align_clocks.h"

namespace rigcal::server {

// One marker of one camera over time, as normalised coordinates (x/z, y/z) without distortion.
struct RayPath {
  std::vector<double> time_s;
  std::vector<Eigen::Vector2d> ray;
};

struct TrackPaths {
  std::vector<RayPath> markers;
  double focal_px = 1;
  double gap_s = 0;  // a longer pause ends a path
  double period_s = 0;
};

// The rows of a track at rig times `times_ns` (one each), in seconds from `origin_ns`, without
// outlying centres and those that have no ray. Of more than 16 markers evenly chosen ones have a
// path.
TrackPaths PathsOf(const AlignedTrack& track, const std::vector<int64_t>& times_ns,
                   int64_t origin_ns, int marker_count);

// Cubic through the four rows around a time; none where they do not follow each other closely.
std::optional<Eigen::Vector2d> At(const RayPath& path, double time_s, double gap_s);

}  // namespace rigcal::server
