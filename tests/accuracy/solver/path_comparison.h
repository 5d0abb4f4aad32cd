// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::accuracy {

// Positions at even times.
struct ReferencePath {
  double rate_hz = 0;
  std::vector<Eigen::Vector3d> positions_m;
};

struct TimedPosition {
  double time_s = 0;
  Eigen::Vector3d position;  // in any unit and frame
};

struct PathErrors {
  size_t count = 0;
  double mean_m = 0, rms_m = 0, median_m = 0;
  // reference time = time_scale * (time - the first position's) + time_offset_s
  double time_scale = 1, time_offset_s = 0;
};

// What may be fitted besides a rotation, a translation and a time offset.
struct PathFreedom {
  bool length_scale = true;
  bool time_scale = true;
};

// Reads `x y z` in metres, line by line. NOT_FOUND, INVALID_ARGUMENT.
absl::StatusOr<ReferencePath> LoadReferencePath(const std::filesystem::path& file, double rate_hz);

// Distances of the positions, which are sorted by time, from the reference path after the
// similarity or rigid motion (Umeyama 1991), the time scale and the time offset that make their
// squares least.
// Between its rows the reference is a cubic (Catmull-Rom); its time is searched over all of it.
// FAILED_PRECONDITION: fewer than 10 positions, or a path that does not have their length.
absl::StatusOr<PathErrors> ComparePaths(const std::vector<TimedPosition>& path,
                                        const ReferencePath& reference,
                                        const PathFreedom& freedom = {});

}  // namespace rigcal::accuracy
