// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"
#include "common/text/line_reader.h"

namespace rigcal::client {
namespace {

struct TrajectoryColumns {
  size_t time = 0;
  size_t axis[3] = {};
  std::optional<size_t> label;
};

std::optional<size_t> FindColumn(const std::vector<std::string>& header,
                                 std::initializer_list<const char*> names) {
  for (const char* const name : names) {
    const auto found = std::find(header.begin(), header.end(), name);
    if (found != header.end()) return static_cast<size_t>(found - header.begin());
  }
  return std::nullopt;
}

std::vector<std::string> CellsOf(std::string_view line) {
  std::vector<std::string> cells = absl::StrSplit(absl::string_view(line.data(), line.size()), ',');
  for (std::string& cell : cells) absl::StripAsciiWhitespace(&cell);
  return cells;
}

absl::Status LineFault(const std::string& path, uint64_t line, const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat(path, ", line ", line, ": ", why));
}

absl::StatusOr<TrajectoryColumns> ColumnsOf(const std::string& path, uint64_t line,
                                            const std::vector<std::string>& header) {
  const auto time = FindColumn(header, {"time_s", "rig_time_s", "time", "t"});
  const auto x = FindColumn(header, {"x_m", "x"});
  const auto y = FindColumn(header, {"y_m", "y"});
  const auto z = FindColumn(header, {"z_m", "z"});
  if (!time || !x || !y || !z) {
    return LineFault(path, line,
                     "the header does not name time_s, x_m, y_m and z_m (seconds, metres)");
  }
  return TrajectoryColumns{*time, {*x, *y, *z}, FindColumn(header, {"label", "marker", "name"})};
}

// False: the row says that the point was not seen.
absl::StatusOr<bool> PointOf(const std::string& path, uint64_t line,
                             const std::vector<std::string>& cells,
                             const TrajectoryColumns& columns, TrajectoryPoint* point) {
  const auto cell = [&cells](size_t i) { return i < cells.size() ? cells[i] : std::string(); };
  if (!absl::SimpleAtod(cell(columns.time), &point->time_s) || !std::isfinite(point->time_s)) {
    return LineFault(path, line, "the time is not a finite number");
  }
  for (int i = 0; i < 3; ++i) {
    const std::string text = cell(columns.axis[i]);
    if (text.empty()) return false;
    if (!absl::SimpleAtod(text, &point->position_m[i]) || std::isinf(point->position_m[i])) {
      return LineFault(path, line, "a coordinate is not a number");
    }
    if (std::isnan(point->position_m[i])) return false;
  }
  return true;
}

}  // namespace

absl::StatusOr<Trajectories> ReadTrajectories(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(agent::LineReader reader, agent::LineReader::Open(path));
  std::optional<TrajectoryColumns> columns;
  Trajectories trajectories;
  for (;;) {
    RIGCAL_ASSIGN_OR_RETURN(const auto line, reader.Next());
    if (!line) break;
    if (line->too_long) return LineFault(path, line->number, "is too long");
    if (line->text.empty() || line->text[0] == '#') continue;
    const std::vector<std::string> cells = CellsOf(line->text);
    if (!columns) {
      RIGCAL_ASSIGN_OR_RETURN(columns, ColumnsOf(path, line->number, cells));
      continue;
    }
    TrajectoryPoint point;
    RIGCAL_ASSIGN_OR_RETURN(const bool seen, PointOf(path, line->number, cells, *columns, &point));
    if (!seen) continue;
    const size_t label = columns->label.value_or(cells.size());
    trajectories[label < cells.size() ? cells[label] : ""].push_back(point);
  }
  if (trajectories.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": has no positions"));
  }
  for (auto& [label, points] : trajectories) {
    std::stable_sort(points.begin(), points.end(),
                     [](const auto& a, const auto& b) { return a.time_s < b.time_s; });
    const auto twice =
        std::adjacent_find(points.begin(), points.end(),
                           [](const auto& a, const auto& b) { return a.time_s == b.time_s; });
    if (twice == points.end()) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": has two positions", label.empty() ? "" : absl::StrCat(" of ", label), " at time ",
        twice->time_s, " s; name the points in a column label where there are several"));
  }
  return trajectories;
}

std::optional<Eigen::Vector3d> PositionAt(const std::vector<TrajectoryPoint>& trajectory,
                                          double time_s, double longest_gap_s) {
  const auto after = std::lower_bound(
      trajectory.begin(), trajectory.end(), time_s,
      [](const TrajectoryPoint& point, double time) { return point.time_s < time; });
  if (after == trajectory.end()) return std::nullopt;
  if (after->time_s == time_s) return after->position_m;
  if (after == trajectory.begin()) return std::nullopt;
  const TrajectoryPoint& b = *(after - 1);
  const TrajectoryPoint& c = *after;
  const double step_s = c.time_s - b.time_s;
  if (step_s > longest_gap_s) return std::nullopt;
  // Velocities from the rows around, where those are near.
  const auto velocity = [&](auto before, auto behind) -> Eigen::Vector3d {
    return (behind->position_m - before->position_m) / (behind->time_s - before->time_s);
  };
  const bool has_a =
      after - 1 != trajectory.begin() && b.time_s - (after - 2)->time_s <= longest_gap_s;
  const bool has_d =
      after + 1 != trajectory.end() && (after + 1)->time_s - c.time_s <= longest_gap_s;
  const Eigen::Vector3d vb = velocity(has_a ? after - 2 : after - 1, after);
  const Eigen::Vector3d vc = velocity(after - 1, has_d ? after + 1 : after);
  const double u = (time_s - b.time_s) / step_s, v = 1 - u;
  return b.position_m * (v * v * (1 + 2 * u)) + c.position_m * (u * u * (1 + 2 * v)) +
         step_s * (vb * (u * v * v) - vc * (u * u * v));
}

}  // namespace rigcal::client
