// SPDX-License-Identifier: Apache-2.0
#include "common/target/csv_line.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <system_error>

#include "absl/container/inlined_vector.h"
#include "absl/numeric/int128.h"
#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

constexpr double kNotSeen = -1;

// Bytes of a damaged file must not reach a log or a protobuf string as they are.
std::string Quoted(std::string_view field) {
  constexpr size_t kShown = 32;
  return absl::StrCat("\"", absl::CHexEscape(std::string(field.substr(0, kShown))),
                      field.size() > kShown ? "...\"" : "\"");
}

using Fields = absl::InlinedVector<std::string_view, 16>;

Fields FieldsOf(std::string_view line, char separator) {
  Fields fields;
  for (bool last = false; !last;) {
    const size_t end = std::min(line.find(separator), line.size());
    last = end == line.size();
    const absl::string_view field = absl::StripAsciiWhitespace({line.data(), end});
    fields.emplace_back(field.data(), field.size());
    line.remove_prefix(last ? end : end + 1);
  }
  return fields;
}

// A decimal number, exactly, times `unit`, where that is whole: digits, a point, an exponent.
// None: it is not; `is_number` says whether it is a number all the same.
std::optional<int64_t> WholeNumber(std::string_view field, int64_t unit, bool* is_number) {
  *is_number = false;
  const bool negative = !field.empty() && field.front() == '-';
  if (negative) field.remove_prefix(1);
  if (field.empty() || !absl::ascii_isdigit(static_cast<unsigned char>(field.front()))) return {};
  absl::int128 value = 0;
  int behind_point = 0, exponent = 0;
  bool seen_point = false, too_large = false;
  constexpr int kMostDigits = 30;  // what unit and sign leave of 128 bits
  int digits = 0;
  size_t i = 0;
  for (; i < field.size(); ++i) {
    const char c = field[i];
    if (c == '.' && !seen_point) {
      seen_point = true;
      continue;
    }
    if (!absl::ascii_isdigit(static_cast<unsigned char>(c))) break;
    if (seen_point) ++behind_point;
    if (c == '0' && value == 0) continue;
    if (++digits > kMostDigits) {
      if (c != '0' || !seen_point) too_large = true;
      if (seen_point) --behind_point;
      continue;
    }
    value = value * 10 + (c - '0');
  }
  if (i < field.size()) {
    if (field[i] != 'e' && field[i] != 'E') return {};
    const char* begin = field.data() + i + 1;
    const char* const end = field.data() + field.size();
    if (begin != end && *begin == '+') ++begin;
    const auto [stopped, error] = std::from_chars(begin, end, exponent);
    if (error != std::errc() || stopped != end) return {};
  }
  *is_number = true;
  value *= unit;
  int power = exponent - behind_point;
  for (; power < 0 && value != 0; ++power) {
    if (value % 10 != 0) return {};
    value /= 10;
  }
  constexpr absl::int128 kMost = std::numeric_limits<int64_t>::max();
  for (; power > 0 && value != 0 && value <= kMost; --power) value *= 10;
  if (negative) value = -value;
  if (too_large || value > kMost || value < -kMost - 1) return {};
  return static_cast<int64_t>(value);
}

CsvLineFault TimeFault(std::string_view field, int64_t unit_ns, bool is_number) {
  std::string why = " is not a whole number of nanoseconds";
  double number = 0;
  const bool known = absl::SimpleAtod({field.data(), field.size()}, &number);
  const bool has_decimals = field.find('.') != field.npos;
  if (is_number && known && std::abs(number) > 9.2e18) {
    why = " does not fit 64 bits of nanoseconds";
  } else if (is_number && unit_ns > 1) {
    why = " is not a whole number of nanoseconds, in the unit that the header names";
  } else if (is_number && has_decimals) {
    why += absl::StrCat(
        ", as seconds with decimals are not: stamps are whole nanoseconds; ",
        "multiply seconds by 1e9, or name the column in a header by its unit: time_s, time_ms or "
        "time_us");
  } else if (is_number && known && std::abs(number) < 1) {
    why += "; write it in whole nanoseconds";
  }
  return {RefusalReason::kCsvBadTime, absl::StrCat("timestamp ", Quoted(field), why)};
}

std::optional<CsvLineFault> ParseTime(std::string_view field, int64_t unit_ns, int64_t* time_ns) {
  const char* end = field.data() + field.size();
  if (unit_ns == 1) {
    const auto [stopped, error] = std::from_chars(field.data(), end, *time_ns);
    if (error == std::errc() && stopped == end) return std::nullopt;
  }
  bool is_number = false;
  const std::optional<int64_t> whole = WholeNumber(field, unit_ns, &is_number);
  if (!whole) return TimeFault(field, unit_ns, is_number);
  *time_ns = *whole;
  return std::nullopt;
}

std::optional<CsvLineFault> ParseCoordinate(std::string_view field, int marker, char axis,
                                            double* value_px) {
  const char* end = field.data() + field.size();
  const auto [stopped, error] = std::from_chars(field.data(), end, *value_px);
  const bool is_number = stopped == end && error != std::errc::invalid_argument;
  if (!is_number) {
    const bool decimal_comma = stopped < end && *stopped == ',';
    return CsvLineFault{
        RefusalReason::kCsvNotANumber,
        absl::StrCat(std::string(1, axis), marker, " is ", Quoted(field), ", not a number",
                     decimal_comma ? ": write decimals with a point, not with a comma" : "")};
  }
  if (error == std::errc::result_out_of_range || std::isinf(*value_px)) {
    return CsvLineFault{
        RefusalReason::kCsvNotFinite,
        absl::StrCat(std::string(1, axis), marker, " is ", Quoted(field), ", not a finite number")};
  }
  return std::nullopt;
}

}  // namespace

std::string CsvLineExample(int marker_count) {
  std::string example = "598370000";
  for (int marker = 0; marker < marker_count; ++marker) {
    absl::StrAppend(&example, ";", 570 - 40 * marker, ".52;", 386 + 3 * marker, ".47");
  }
  return example;
}

std::optional<CsvLineFault> ParseCsvLine(std::string_view line, int marker_count, double sigma_px,
                                         Observation* observation) {
  return ParseCsvLine(line, CsvLayout::Of(marker_count), sigma_px, observation);
}

std::optional<CsvLineFault> ParseCsvLine(std::string_view line, const CsvLayout& layout,
                                         double sigma_px, Observation* observation) {
  Fields fields = FieldsOf(line, layout.separator);
  const auto columns = static_cast<size_t>(layout.columns);
  if (layout.trailing_separator && fields.size() == columns + 1 && fields.back().empty()) {
    fields.pop_back();
  }
  if (fields.size() != columns) {
    return CsvLineFault{
        RefusalReason::kCsvFieldCount,
        absl::StrCat(fields.size(), fields.size() == 1 ? " field" : " fields", " instead of ",
                     columns, " (timestamp and x;y of ", layout.markers.size(), " markers)")};
  }
  if (auto fault = ParseTime(fields[static_cast<size_t>(layout.time_column)], layout.time_unit_ns,
                             &observation->time_ns)) {
    return fault;
  }

  observation->markers.assign(layout.markers.size(), MarkerObservation{});
  for (size_t index = 0; index < layout.markers.size(); ++index) {
    const std::string_view x = fields[static_cast<size_t>(layout.markers[index].first)];
    const std::string_view y = fields[static_cast<size_t>(layout.markers[index].second)];
    if (x.empty() && y.empty()) continue;
    double x_px = kNotSeen;
    double y_px = kNotSeen;
    const auto number = static_cast<int>(index);
    if (!x.empty()) {
      if (auto fault = ParseCoordinate(x, number, 'x', &x_px)) return fault;
    }
    if (!y.empty()) {
      if (auto fault = ParseCoordinate(y, number, 'y', &y_px)) return fault;
    }
    const bool x_seen = x_px != kNotSeen && !std::isnan(x_px);
    const bool y_seen = y_px != kNotSeen && !std::isnan(y_px);
    if (x_seen != y_seen) {
      return CsvLineFault{RefusalReason::kCsvHalfMarker,
                          absl::StrCat("marker ", index, " has only one of x and y (", Quoted(x),
                                       ", ", Quoted(y), "); a marker that was not seen is -1;-1")};
    }
    if (!x_seen) continue;
    MarkerObservation& marker = observation->markers[index];
    marker.visible = true;
    marker.centre_px = {x_px, y_px};
    marker.covariance_px2 = Eigen::Matrix2d::Identity() * (sigma_px * sigma_px);
    marker.centre_kind = CentreKind::kImageBlob;
  }
  return std::nullopt;
}

}  // namespace rigcal
