// SPDX-License-Identifier: Apache-2.0
#include "common/target/csv_layout.h"

#include <algorithm>
#include <map>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"
#include "common/target/csv_plausible.h"
#include "common/text/line_reader.h"
#include "common/text/utf16.h"

namespace rigcal {
namespace {

// A recording may begin with damaged lines; what most of the first ones are like decides.
constexpr size_t kLinesLookedAt = 100;
// And whether they can be markers: the wand may come late.
constexpr size_t kLinesCompared = 1000;
constexpr char kSeparators[] = {';', '\t', ','};

bool StartsLikeANumber(absl::string_view line) {
  line = absl::StripLeadingAsciiWhitespace(line);
  return !line.empty() && (absl::ascii_isdigit(static_cast<unsigned char>(line.front())) ||
                           line.front() == '-' || line.front() == '.' || line.front() == '+');
}

// A number of columns that rows can have: a time, and a pair for each marker.
bool IsRow(int columns) { return columns >= 3 && columns % 2 == 1; }

struct Shape {
  int columns = 0;
  bool trailing = false;
  friend auto operator<=>(const Shape&, const Shape&) = default;
};

Shape ShapeOf(const std::string& line, char separator) {
  const int fields = CsvFieldCount(line, separator);
  const absl::string_view text = absl::StripTrailingAsciiWhitespace(line);
  const bool trailing = !text.empty() && text.back() == separator && separator != '\t';
  return trailing && !IsRow(fields) ? Shape{fields - 1, true} : Shape{fields, false};
}

// The unit at the end of a column's name, in nanoseconds; 0: none.
int64_t UnitAtTheEnd(const std::string& name) {
  const std::pair<const char*, int64_t> units[] = {{"ns", 1},
                                                   {"nanoseconds", 1},
                                                   {"us", 1'000},
                                                   {"microseconds", 1'000},
                                                   {"ms", 1'000'000},
                                                   {"milliseconds", 1'000'000},
                                                   {"s", 1'000'000'000},
                                                   {"sec", 1'000'000'000},
                                                   {"seconds", 1'000'000'000}};
  const size_t cut = name.find_last_of("_ ([.-");
  if (cut == std::string::npos) return 0;
  std::string ending = name.substr(cut + 1);
  while (!ending.empty() && !absl::ascii_isalpha(static_cast<unsigned char>(ending.back()))) {
    ending.pop_back();
  }
  for (const auto& [unit, factor] : units) {
    if (ending == unit) return factor;
  }
  return 0;
}

bool NamesTime(const std::string& name) {
  const bool is_t = name.substr(0, name.find_first_of(" _([")) == "t";
  return absl::StrContains(name, "time") || absl::StrContains(name, "stamp") || name == "t" ||
         (is_t && UnitAtTheEnd(name) > 0);
}

bool NamesNothingOfUse(const std::string& name) {
  static constexpr const char* kWords[] = {"frame",      "index", "row",   "likelihood", "score",
                                           "confidence", "prob",  "visib", "quality"};
  return name.empty() || name == "id" || name == "#" || name == "n" ||
         std::ranges::any_of(kWords,
                             [&](const char* word) { return absl::StrContains(name, word); });
}

// 'x' or 'y', whichever coordinate a name is of; 0: neither. "x0", "x_left", "left_x", "m1.x".
char AxisOf(const std::string& name) {
  for (const char axis : {'x', 'y'}) {
    const auto is_mark = [](char c) { return !absl::ascii_isalpha(static_cast<unsigned char>(c)); };
    std::string bare = name;
    for (const char* const unit : {"_px", " px", "(px)", "[px]"}) {
      if (absl::EndsWith(bare, unit)) bare.resize(bare.size() - std::string(unit).size());
    }
    if (bare.front() == axis && (bare.size() == 1 || is_mark(bare[1]))) return axis;
    if (bare.back() == axis && is_mark(bare[bare.size() - 2])) return axis;
    // "left_x0"
    const size_t digits = bare.find_last_not_of("0123456789");
    if (digits != std::string::npos && digits > 0 && digits + 1 < bare.size() &&
        bare[digits] == axis && is_mark(bare[digits - 1])) {
      return axis;
    }
  }
  return 0;
}

absl::StatusOr<CsvLayout> LayoutOfHeader(const std::string& line, char separator) {
  CsvLayout layout;
  layout.separator = separator;
  layout.has_header = true;
  std::vector<std::string> names = absl::StrSplit(line, separator);
  for (std::string& name : names) {
    absl::AsciiStrToLower(&name);
    absl::StripAsciiWhitespace(&name);
    if (name.size() >= 2 && name.front() == '"' && name.back() == '"') {
      name = name.substr(1, name.size() - 2);
    }
  }
  layout.columns = static_cast<int>(names.size());
  std::optional<int> time;
  std::vector<int> x, y;
  std::vector<std::string> unknown;
  for (int i = 0; i < layout.columns; ++i) {
    const std::string& name = names[static_cast<size_t>(i)];
    if (!time && NamesTime(name)) {
      time = i;
      layout.time_unit_ns = std::max<int64_t>(1, UnitAtTheEnd(name));
    } else if (NamesNothingOfUse(name)) {
      continue;
    } else if (const char axis = AxisOf(name); axis != 0) {
      (axis == 'x' ? x : y).push_back(i);
    } else {
      unknown.push_back(name);
    }
  }
  if (!time || x.empty() || x.size() != y.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the header names ", time ? "a time" : "no time", ", ", x.size(),
                     " columns of x and ", y.size(), " of y",
                     unknown.empty() ? "" : absl::StrCat(", and ", absl::StrJoin(unknown, ", ")),
                     "; expected are names like timestamp_ns, x0, y0, x1, y1"));
  }
  layout.time_column = *time;
  for (size_t i = 0; i < x.size(); ++i) layout.markers.emplace_back(x[i], y[i]);
  return layout;
}

}  // namespace

CsvLayout CsvLayout::Of(int marker_count) {
  CsvLayout layout;
  layout.columns = 1 + 2 * marker_count;
  for (int i = 0; i < marker_count; ++i) layout.markers.emplace_back(1 + 2 * i, 2 + 2 * i);
  return layout;
}

int CsvFieldCount(std::string_view line, char separator) {
  return 1 + static_cast<int>(std::count(line.begin(), line.end(), separator));
}

absl::StatusOr<CsvLayout> FindCsvLayout(const std::vector<std::string>& lines) {
  const bool has_header = !lines.empty() && !StartsLikeANumber(lines.front());
  const size_t first = has_header ? 1 : 0;
  CsvLayout best;
  int best_count = 0;
  for (const char separator : kSeparators) {
    std::map<Shape, int> counts;
    for (size_t i = first; i < lines.size(); ++i) {
      const Shape shape = ShapeOf(lines[i], separator);
      if (has_header ? shape.columns >= 3 : IsRow(shape.columns)) ++counts[shape];
    }
    for (const auto& [shape, count] : counts) {
      if (count <= best_count) continue;
      best_count = count;
      best = CsvLayout::Of((shape.columns - 1) / 2);
      best.columns = shape.columns;
      best.separator = separator;
      best.trailing_separator = shape.trailing;
    }
  }
  if (!has_header || best_count == 0) return best;
  // A damaged first line is one row; a header has the columns of the rows.
  const Shape header = ShapeOf(lines.front(), best.separator);
  absl::StatusOr<CsvLayout> named = LayoutOfHeader(lines.front(), best.separator);
  if (named.ok() && header.columns == best.columns) {
    named->columns = best.columns;
    named->trailing_separator = best.trailing_separator;
    return named;
  }
  if (named.ok() && header.columns < best.columns && best.separator == ',') {
    return absl::InvalidArgumentError(absl::StrCat(
        "the header names ", header.columns, " columns, and rows have ", best.columns,
        best.columns >= 2 * header.columns - 1
            ? ": are decimals written with a comma, and cells separated by commas, too? Write "
              "decimals with a point, or separate cells by semicolons"
            : "; name every column"));
  }
  const bool is_words = absl::ascii_isalpha(
      static_cast<unsigned char>(absl::StripLeadingAsciiWhitespace(lines.front()).front()));
  if (IsRow(best.columns) && !(is_words && header.columns == best.columns)) return best;
  return named.ok() ? best : named;
}

absl::StatusOr<CsvLayout> FindCsvLayoutOfFile(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(agent::LineReader reader, agent::LineReader::Open(path));
  std::vector<std::string> lines;
  while (lines.size() < kLinesCompared) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<agent::LineReader::Line> line, reader.Next());
    if (!line) break;
    if (line->too_long ||
        absl::StripAsciiWhitespace({line->text.data(), line->text.size()}).empty()) {
      continue;
    }
    if (line->number == 1 && BeginsLikeUtf16(line->text)) {
      return absl::InvalidArgumentError(
          absl::StrCat(path,
                       ": is written as UTF-16; save it as UTF-8 (in a spreadsheet \"CSV "
                       "UTF-8\", not \"Unicode text\")"));
    }
    lines.emplace_back(line->text);
  }
  const std::vector<std::string> first(
      lines.begin(),
      lines.begin() + static_cast<std::ptrdiff_t>(std::min(lines.size(), kLinesLookedAt)));
  absl::StatusOr<CsvLayout> layout = FindCsvLayout(first);
  if (!layout.ok()) {
    return absl::Status(layout.status().code(),
                        absl::StrCat(path, ": ", std::string(layout.status().message())));
  }
  if (const std::string why = ImplausibleColumns(*layout, lines); !why.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": ", why));
  }
  return layout;
}

}  // namespace rigcal
