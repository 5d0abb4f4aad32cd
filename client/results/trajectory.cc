// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/status/status_macros.h"
#include "common/text/line_reader.h"
#include "common/text/utf16.h"

namespace rigcal::client {
namespace {

// What a column holds, and what its numbers are times, to be seconds or metres.
struct Column {
  size_t index = 0;
  double factor = 1;
};

// A point's columns in a row.
struct PointColumns {
  std::string label;
  Column axis[3];
};

struct TrajectoryColumns {
  Column time;
  std::vector<PointColumns> points;
  std::optional<size_t> label;  // a column that names the row's point
};

constexpr std::pair<const char*, double> kUnits[] = {{"s", 1},
                                                     {"sec", 1},
                                                     {"seconds", 1},
                                                     {"ms", 1e-3},
                                                     {"us", 1e-6},
                                                     {"ns", 1e-9},
                                                     {"m", 1},
                                                     {"meters", 1},
                                                     {"metres", 1},
                                                     {"cm", 1e-2},
                                                     {"mm", 1e-3},
                                                     {"centimeters", 1e-2},
                                                     {"millimeters", 1e-3}};

std::optional<double> FactorOf(const std::string& unit) {
  for (const auto& [name, factor] : kUnits) {
    if (unit == name) return factor;
  }
  return std::nullopt;
}

// "Time (ms)", "x_mm", "X [mm]" and "x" to a name in lower case and its unit's factor.
std::pair<std::string, double> NameAndFactor(std::string text) {
  absl::AsciiStrToLower(&text);
  const size_t cut = text.find_last_of("([_");
  if (cut == std::string::npos) return {text, 1};
  std::string unit = text.substr(cut + 1);
  while (!unit.empty() && (unit.back() == ')' || unit.back() == ']')) unit.pop_back();
  const std::optional<double> factor = FactorOf(unit);
  if (!factor) return {text, 1};
  std::string name = text.substr(0, cut);
  absl::StripAsciiWhitespace(&name);
  return {name, *factor};
}

std::optional<Column> FindColumn(const std::vector<std::string>& header,
                                 std::initializer_list<const char*> names) {
  for (const char* const wanted : names) {
    for (size_t i = 0; i < header.size(); ++i) {
      const auto [name, factor] = NameAndFactor(header[i]);
      if (name == wanted) return Column{i, factor};
    }
  }
  return std::nullopt;
}

// How the cells of a file are told apart. ' ': by any white space.
char SeparatorOf(absl::string_view line) {
  for (const char separator : {';', '\t', ','}) {
    if (absl::StrContains(line, separator)) return separator;
  }
  return ' ';
}

std::vector<std::string> CellsOf(absl::string_view line, char separator) {
  std::vector<std::string> cells;
  if (separator == ' ') {
    cells = absl::StrSplit(line, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
  } else {
    cells = absl::StrSplit(line, separator);
  }
  for (std::string& cell : cells) {
    absl::StripAsciiWhitespace(&cell);
    if (separator == ';') std::ranges::replace(cell, ',', '.');
  }
  return cells;
}

absl::Status LineFault(const std::string& path, uint64_t line, const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat(path, ", line ", line, ": ", why));
}

// The first line of a file without a header: time x y z, or with the quaternion of a TUM file.
std::optional<TrajectoryColumns> ColumnsOfNumbers(const std::vector<std::string>& cells) {
  if (cells.size() != 4 && cells.size() != 8) return std::nullopt;
  double number = 0;
  for (const std::string& cell : cells) {
    if (!absl::SimpleAtod(cell, &number)) return std::nullopt;
  }
  return TrajectoryColumns{.time = {0}, .points = {{"", {{1}, {2}, {3}}}}, .label = {}};
}

absl::StatusOr<TrajectoryColumns> ColumnsOf(const std::string& path, uint64_t line,
                                            const std::vector<std::string>& header) {
  const auto time = FindColumn(header, {"time", "rig_time", "t", "timestamp"});
  const auto x = FindColumn(header, {"x"});
  const auto y = FindColumn(header, {"y"});
  const auto z = FindColumn(header, {"z"});
  if (!time || !x || !y || !z) {
    return LineFault(path, line,
                     absl::StrCat("the header does not name time_s, x_m, y_m and z_m (or ..._ms, "
                                  "..._mm); its columns are ",
                                  absl::StrJoin(header, ", ")));
  }
  const auto label = FindColumn(header, {"label", "marker", "name"});
  return TrajectoryColumns{.time = *time,
                           .points = {{"", {*x, *y, *z}}},
                           .label = label ? std::optional(label->index) : std::nullopt};
}

// The header of an export of Motive, over several lines: its length unit, then one line each of
// kinds, names, ... and at last of axes.
class MotiveHeader {
 public:
  static bool Begins(const std::vector<std::string>& cells) { return cells[0] == "Format Version"; }

  // The columns, once the header is complete.
  absl::StatusOr<std::optional<TrajectoryColumns>> Next(const std::string& path, uint64_t line,
                                                        const std::vector<std::string>& cells) {
    if (cells[0] != "Frame") {
      rows_.push_back(cells);
      return std::nullopt;
    }
    double factor = 1;
    for (size_t i = 0; i + 1 < rows_[0].size(); ++i) {
      if (rows_[0][i] != "Length Units") continue;
      factor = FactorOf(absl::AsciiStrToLower(rows_[0][i + 1])).value_or(0);
    }
    if (factor == 0) return LineFault(path, 1, "its length unit is not known");
    TrajectoryColumns columns{.time = {1}, .points = {}, .label = {}};
    const auto cell = [&](size_t row, size_t i) {
      return row < rows_.size() && i < rows_[row].size() ? rows_[row][i] : std::string();
    };
    for (size_t i = 2; i + 2 < cells.size(); ++i) {
      if (cells[i] != "X" || cells[i + 1] != "Y" || cells[i + 2] != "Z") continue;
      if (cell(rows_.size() - 1, i) != "Position") continue;
      columns.points.push_back({cell(2, i), {{i, factor}, {i + 1, factor}, {i + 2, factor}}});
    }
    if (columns.points.empty()) return LineFault(path, line, "has no positions of markers");
    return columns;
  }

 private:
  std::vector<std::vector<std::string>> rows_;
};

absl::StatusOr<double> TimeOf(const std::string& path, uint64_t line,
                              const std::vector<std::string>& cells, const Column& column) {
  double time = 0;
  if (column.index >= cells.size() || !absl::SimpleAtod(cells[column.index], &time) ||
      !std::isfinite(time)) {
    return LineFault(path, line, "the time is not a finite number");
  }
  return time * column.factor;
}

// None: the row says that the point was not seen.
absl::StatusOr<std::optional<Eigen::Vector3d>> PositionOf(const std::string& path, uint64_t line,
                                                          const std::vector<std::string>& cells,
                                                          const PointColumns& columns) {
  Eigen::Vector3d position_m;
  for (int i = 0; i < 3; ++i) {
    const Column& column = columns.axis[i];
    if (column.index >= cells.size() || cells[column.index].empty()) return std::nullopt;
    if (!absl::SimpleAtod(cells[column.index], &position_m[i]) || std::isinf(position_m[i])) {
      return LineFault(path, line, "a coordinate is not a number");
    }
    if (std::isnan(position_m[i])) return std::nullopt;
    position_m[i] *= column.factor;
  }
  return position_m;
}

}  // namespace

absl::StatusOr<Trajectories> ReadTrajectories(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(agent::LineReader reader, agent::LineReader::Open(path));
  std::optional<TrajectoryColumns> columns;
  std::optional<MotiveHeader> motive;
  char separator = ',';
  Trajectories trajectories;
  for (;;) {
    RIGCAL_ASSIGN_OR_RETURN(const auto line, reader.Next());
    if (!line) break;
    if (line->number == 1 && BeginsLikeUtf16(line->text)) {
      return LineFault(path, 1, "the file is written as UTF-16; save it as UTF-8");
    }
    if (line->too_long) return LineFault(path, line->number, "is too long");
    absl::string_view text(line->text.data(), line->text.size());
    absl::ConsumePrefix(&text, "\xef\xbb\xbf");
    text = absl::StripAsciiWhitespace(text);
    if (text.empty() || text[0] == '#') continue;
    if (!columns && !motive) separator = SeparatorOf(text);
    const std::vector<std::string> cells = CellsOf(text, separator);
    if (!columns) {
      if (!motive && MotiveHeader::Begins(cells)) motive.emplace();
      if (motive) {
        RIGCAL_ASSIGN_OR_RETURN(columns, motive->Next(path, line->number, cells));
        continue;
      }
      columns = ColumnsOfNumbers(cells);
      if (!columns) {
        RIGCAL_ASSIGN_OR_RETURN(columns, ColumnsOf(path, line->number, cells));
        continue;
      }
    }
    RIGCAL_ASSIGN_OR_RETURN(const double time_s, TimeOf(path, line->number, cells, columns->time));
    for (const PointColumns& point : columns->points) {
      RIGCAL_ASSIGN_OR_RETURN(const auto position_m, PositionOf(path, line->number, cells, point));
      if (!position_m) continue;
      const bool has_label = columns->label && *columns->label < cells.size();
      trajectories[has_label ? cells[*columns->label] : point.label].push_back(
          {time_s, *position_m});
    }
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
