// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/csv_event_line.h"

#include <algorithm>
#include <charconv>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMaxFields = 32;

std::string Quoted(std::string_view field) {
  constexpr size_t kShown = 32;
  return absl::StrCat("\"", absl::CHexEscape(std::string(field.substr(0, kShown))),
                      field.size() > kShown ? "...\"" : "\"");
}

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
bool IsSeparator(char c) { return c == ',' || c == ';'; }

// The next field of `rest`; false: there is none.
bool TakeField(std::string_view* rest, std::string_view* field) {
  size_t begin = 0;
  while (begin < rest->size() && IsBlank((*rest)[begin])) ++begin;
  if (begin == rest->size()) return false;
  size_t end = begin;
  while (end < rest->size() && !IsBlank((*rest)[end]) && !IsSeparator((*rest)[end])) ++end;
  *field = rest->substr(begin, end - begin);
  while (end < rest->size() && IsBlank((*rest)[end])) ++end;
  if (end < rest->size() && IsSeparator((*rest)[end])) ++end;
  rest->remove_prefix(end);
  return true;
}

// A whole number, also with ".0" as tables of floats have it.
bool ParseWhole(std::string_view field, int64_t* value) {
  if (field.starts_with('+')) field.remove_prefix(1);
  const char* const end = field.data() + field.size();
  const auto [stopped, error] = std::from_chars(field.data(), end, *value);
  if (error != std::errc()) return false;
  if (stopped == end) return true;
  return *stopped == '.' && std::all_of(stopped + 1, end, [](char c) { return c == '0'; });
}

bool ParseFraction(std::string_view field, TimeUnit unit, int64_t* time_us) {
  const char* const end = field.data() + field.size();
  double value = 0;
  const auto [stopped, error] = std::from_chars(field.data(), end, value);
  if (error != std::errc() || stopped != end) return false;
  return ToMicroseconds(value, unit, time_us);
}

// Seconds with a fraction, without the error of a double: 1e9 s and 1e-6 s have 16 digits.
bool ParseDecimalSeconds(std::string_view field, int64_t* time_us) {
  const bool negative = field.starts_with('-');
  if (negative || field.starts_with('+')) field.remove_prefix(1);
  const size_t point = field.find('.');
  if (point == field.npos || point > 12 || field.size() < 2) return false;
  int64_t seconds = 0, fraction_us = 0;
  for (const char c : field.substr(0, point)) {
    if (!absl::ascii_isdigit(static_cast<unsigned char>(c))) return false;
    seconds = 10 * seconds + (c - '0');
  }
  const std::string_view digits = field.substr(point + 1);
  for (size_t i = 0; i < std::max<size_t>(digits.size(), 6); ++i) {
    const char c = i < digits.size() ? digits[i] : '0';
    if (!absl::ascii_isdigit(static_cast<unsigned char>(c))) return false;
    if (i < 6) fraction_us = 10 * fraction_us + (c - '0');
    if (i == 6 && c >= '5') ++fraction_us;
  }
  const int64_t magnitude = seconds * 1'000'000 + fraction_us;
  *time_us = negative ? -magnitude : magnitude;
  return true;
}

bool ParseTime(std::string_view field, TimeUnit unit, int64_t* time_us) {
  int64_t whole = 0;
  if (ParseWhole(field, &whole)) return ToMicroseconds(whole, unit, time_us);
  return (unit == TimeUnit::kSeconds && ParseDecimalSeconds(field, time_us)) ||
         ParseFraction(field, unit, time_us);
}

bool ParsePolarity(std::string_view field, bool* on) {
  int64_t value = 0;
  if (ParseWhole(field, &value)) {
    *on = value == 1 || value == 255;  // 255 is ON of masks stored as bytes
    return (value >= -1 && value <= 1) || value == 255;
  }
  const std::string text = absl::AsciiStrToLower(std::string(field));
  *on = text == "true";
  return text == "true" || text == "false";
}

std::string Name(std::string_view field) {
  std::string name = absl::AsciiStrToLower(std::string(field));
  std::erase_if(name, [](char c) { return c == '"' || c == '\'' || c == '#' || c == '%'; });
  return name;
}

// Whether a name is of times, and in which unit.
bool IsTimeName(const std::string& name, TimeUnit* unit) {
  for (const char* const stem : {"timestamp", "time", "ts", "t"}) {
    if (!name.starts_with(stem)) continue;
    const std::string suffix = name.substr(std::string_view(stem).size());
    *unit = TimeUnit::kAuto;
    if (suffix == "_us" || suffix == "[us]") *unit = TimeUnit::kMicroseconds;
    if (suffix == "_ms" || suffix == "[ms]") *unit = TimeUnit::kMilliseconds;
    if (suffix == "_s" || suffix == "[s]" || suffix == "_sec") *unit = TimeUnit::kSeconds;
    if (suffix == "_ns" || suffix == "[ns]") *unit = TimeUnit::kNanoseconds;
    if (suffix.empty() || *unit != TimeUnit::kAuto) return true;
  }
  return false;
}

}  // namespace

CsvFields SplitCsvEventFields(std::string_view line) {
  CsvFields fields;
  std::string_view field;
  while (fields.size() < kMaxFields && TakeField(&line, &field)) fields.push_back(field);
  return fields;
}

bool IsCsvEventHeader(std::string_view line) {
  return std::ranges::all_of(SplitCsvEventFields(line), [](std::string_view field) {
    const std::string name = Name(field);
    return !name.empty() && absl::ascii_isalpha(static_cast<unsigned char>(name.front()));
  });
}

absl::StatusOr<CsvEventColumns> ParseCsvEventHeader(std::string_view line) {
  CsvEventColumns columns;
  std::vector<std::string> missing = {"x", "y", "p", "t"};
  const CsvFields fields = SplitCsvEventFields(line);
  columns.count = fields.size();
  for (size_t i = 0; i < fields.size(); ++i) {
    const std::string name = Name(fields[i]);
    const auto take = [&](const char* what, size_t* column) {
      *column = i;
      std::erase(missing, what);
    };
    if (name == "x") take("x", &columns.x);
    if (name == "y") take("y", &columns.y);
    if (name == "p" || name == "pol" || name == "polarity") take("p", &columns.p);
    if (TimeUnit unit; IsTimeName(name, &unit)) {
      take("t", &columns.t);
      columns.time_unit = unit;
    }
  }
  if (missing.empty()) return columns;
  return InvalidFile("the header line ", Quoted(line), " has no column ",
                     absl::StrJoin(missing, ", "),
                     "; events need x, y, p (or pol, polarity) and t (or ts, time, timestamp)");
}

absl::StatusOr<CsvEventColumns> ParseCsvEventOrder(std::string_view order) {
  std::string sorted(order);
  std::sort(sorted.begin(), sorted.end());
  if (sorted != "ptxy") {
    return InvalidFile("columns ", Quoted(order),
                       " is not an order of x, y, p and t, such as txyp");
  }
  return CsvEventColumns{
      .x = order.find('x'), .y = order.find('y'), .p = order.find('p'), .t = order.find('t')};
}

bool HasTimeFraction(std::string_view line, const CsvEventColumns& columns) {
  const CsvFields fields = SplitCsvEventFields(line);
  if (fields.size() != columns.count) return false;
  int64_t whole = 0, time_us = 0;
  return !ParseWhole(fields[columns.t], &whole) &&
         ParseFraction(fields[columns.t], TimeUnit::kMicroseconds, &time_us);
}

std::optional<std::string> ParseCsvEventLine(std::string_view line, const CsvEventColumns& columns,
                                             TimeUnit unit, PlainEvent* event) {
  const CsvFields fields = SplitCsvEventFields(line);
  if (fields.size() != columns.count) {
    return absl::StrCat(fields.size(), fields.size() == 1 ? " field" : " fields", " instead of ",
                        columns.count);
  }
  int64_t x = 0, y = 0;
  for (const auto& [column, value, name] : {std::tuple{columns.x, &x, "x"}, {columns.y, &y, "y"}}) {
    if (!ParseWhole(fields[column], value)) {
      return absl::StrCat(name, " is ", Quoted(fields[column]), ", not a whole number of pixels");
    }
  }
  bool on = false;
  if (!ParsePolarity(fields[columns.p], &on)) {
    return absl::StrCat("p is ", Quoted(fields[columns.p]), ", none of 0, 1, -1, 255, false, true");
  }
  if (!ParseTime(fields[columns.t], unit, &event->time_us)) {
    return absl::StrCat("t is ", Quoted(fields[columns.t]), ", not a time in ", TimeUnitName(unit));
  }
  event->x = PlainPixel(x);
  event->y = PlainPixel(y);
  event->kind = on ? PlainEvent::kOn : PlainEvent::kOff;
  return std::nullopt;
}

}  // namespace rigcal::agent
