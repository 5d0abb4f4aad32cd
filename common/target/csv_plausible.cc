// SPDX-License-Identifier: Apache-2.0
#include "common/target/csv_plausible.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/target/csv_line.h"

namespace rigcal {
namespace {

constexpr size_t kFewestRows = 20;
constexpr double kMovesPx = 10;                     // more than a resting marker does
constexpr double kOnALine = 0.01, kOffALine = 0.1;  // of the length

std::vector<std::vector<std::string>> CellsOfRows(const CsvLayout& layout,
                                                  const std::vector<std::string>& lines) {
  std::vector<std::vector<std::string>> rows;
  for (const std::string& line : lines) {
    std::vector<std::string> cells = absl::StrSplit(line, layout.separator);
    if (static_cast<int>(cells.size()) < layout.columns) continue;
    for (std::string& cell : cells) absl::StripAsciiWhitespace(&cell);
    rows.push_back(std::move(cells));
  }
  return rows;
}

// "05" is what stands behind a decimal comma, and no coordinate.
bool IsFraction(const std::string& cell) {
  return cell.size() >= 2 && cell[0] == '0' &&
         std::ranges::all_of(cell, [](char c) { return c >= '0' && c <= '9'; });
}

bool HasDecimalCommas(const CsvLayout& layout, const std::vector<std::vector<std::string>>& rows) {
  if (layout.separator != ',' || layout.columns < 5) return false;
  size_t fractions = 0, cells = 0;
  for (const std::vector<std::string>& row : rows) {
    for (size_t i = 1; i < row.size(); ++i) {
      if (row[i].find_first_of(".eE") != std::string::npos) return false;
      fractions += IsFraction(row[i]) ? 1 : 0;
      ++cells;
    }
  }
  return rows.size() >= kFewestRows && fractions * 100 > cells;
}

// How far points are off the line through the outer ones, as a share of its length.
double OffLine(const std::vector<Eigen::Vector2d>& points) {
  const Eigen::Vector2d along = points.back() - points.front();
  double furthest = 0;
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d from = point - points.front();
    furthest = std::max(furthest, std::abs(along.x() * from.y() - along.y() * from.x()));
  }
  return along.squaredNorm() > 0 ? furthest / along.squaredNorm() : 1;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<Observation> ReadRows(const CsvLayout& layout, const std::vector<std::string>& lines) {
  std::vector<Observation> rows;
  for (const std::string& line : lines) {
    Observation row;
    if (!ParseCsvLine(line, layout, 1, &row)) rows.push_back(std::move(row));
  }
  return rows;
}

double MedianOffLine(const CsvLayout& layout, const std::vector<std::string>& lines) {
  std::vector<double> shares;
  for (const Observation& row : ReadRows(layout, lines)) {
    std::vector<Eigen::Vector2d> points;
    for (const MarkerObservation& marker : row.markers) {
      if (marker.visible) points.push_back(marker.centre_px);
    }
    if (points.size() == layout.markers.size()) shares.push_back(OffLine(points));
  }
  return shares.size() < kFewestRows ? -1 : Median(std::move(shares));
}

// Of a straight wand, whose markers are on a line in every image.
bool HasAllXFirst(const CsvLayout& layout, const std::vector<std::string>& lines) {
  const int count = static_cast<int>(layout.markers.size());
  if (count < 3) return false;
  CsvLayout other = layout;
  for (int i = 0; i < count; ++i) {
    other.markers[static_cast<size_t>(i)] = {1 + i, 1 + count + i};
  }
  const double off = MedianOffLine(layout, lines), off_other = MedianOffLine(other, lines);
  return off > kOffALine && off_other >= 0 && off_other < kOnALine;
}

// A column of `rows` that has one value throughout where the other half of its pair has many; -1:
// there is none.
int ConstantColumn(const CsvLayout& layout, const std::vector<std::vector<std::string>>& rows) {
  if (rows.size() < kFewestRows) return -1;
  const auto is_constant = [&rows](int column) {
    const std::string& first = rows[0][static_cast<size_t>(column)];
    if (first.empty() || first == "-1" || absl::AsciiStrToLower(first) == "nan") return false;
    return std::ranges::all_of(
        rows, [&](const auto& row) { return row[static_cast<size_t>(column)] == first; });
  };
  const auto moves = [&rows](int column) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const auto& row : rows) {
      double value = 0;
      if (!absl::SimpleAtod(row[static_cast<size_t>(column)], &value)) continue;
      low = std::min(low, value), high = std::max(high, value);
    }
    return high - low > kMovesPx;
  };
  for (const auto& [x, y] : layout.markers) {
    if (is_constant(x) && moves(y)) return x;
    if (is_constant(y) && moves(x)) return y;
  }
  return -1;
}

std::string HeaderOf(int marker_count, bool all_x_first, char separator) {
  std::string header = "timestamp_ns";
  const std::string between(1, separator);
  for (int i = 0; all_x_first && i < marker_count; ++i) absl::StrAppend(&header, between, "x", i);
  for (int i = 0; i < marker_count; ++i) {
    absl::StrAppend(&header, all_x_first ? "" : absl::StrCat(between, "x", i), between, "y", i);
  }
  return header;
}

}  // namespace

std::string ImplausibleColumns(const CsvLayout& layout, const std::vector<std::string>& lines) {
  if (layout.has_header || layout.markers.empty()) return "";
  const std::vector<std::vector<std::string>> rows = CellsOfRows(layout, lines);
  const int count = static_cast<int>(layout.markers.size());
  if (HasDecimalCommas(layout, rows)) {
    return absl::StrCat(
        "rows have ", layout.columns, " cells, none with a decimal point and some that begin like ",
        "05: are decimals written with a comma, and cells separated by commas, too? Write decimals "
        "with a point, or separate cells by semicolons");
  }
  if (const int column = ConstantColumn(layout, rows); column >= 0) {
    return absl::StrCat("column ", column + 1, " is ",
                        rows[0][static_cast<size_t>(column)].substr(0, 32), " in ", rows.size(),
                        " rows, which no coordinate of a waved marker is: a likelihood, a size, a "
                        "camera's number? Name the columns in a first line like ",
                        HeaderOf(count, false, layout.separator),
                        ", with names like likelihood for the others");
  }
  if (HasAllXFirst(layout, lines)) {
    return absl::StrCat(
        "read as x0, y0, x1, y1, ... the markers of a row are on no line; read as all x, then all "
        "y, they are. Rows without a header have the pairs of each marker together; for these "
        "write "
        "a first line ",
        HeaderOf(count, true, layout.separator));
  }
  return "";
}

}  // namespace rigcal
