// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::client {

// A point's way through time.
struct TrajectoryPoint {
  double time_s = 0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
};
// By label, each sorted by time without equal times; the label is empty where a file has none.
using Trajectories = std::map<std::string, std::vector<TrajectoryPoint>>;

// A table with a header: time_s (or time, t, rig_time_s, timestamp), x_m y_m z_m (or x y z) and,
// where there are several points, label (or marker, name); other columns are ignored. Units at the
// end of a name (time_ms, x_mm, "X [mm]") are taken into account. Cells are separated by commas,
// semicolons, tabs or spaces. Without a header: time x y z, or a TUM file (time x y z qx qy qz qw).
// An export of Motive: its positions, with its length unit. Rows whose position is empty or nan
// were not seen and are left out. NOT_FOUND: no such file. INVALID_ARGUMENT names file, line and
// fault.
absl::StatusOr<Trajectories> ReadTrajectories(const std::string& path);

// Where the point was, by cubic interpolation between its rows (Catmull and Rom 1974, for rows that
// are not equally far apart). None: outside of its time, or in a gap of more than `longest_gap_s`.
std::optional<Eigen::Vector3d> PositionAt(const std::vector<TrajectoryPoint>& trajectory,
                                          double time_s, double longest_gap_s);

}  // namespace rigcal::client
