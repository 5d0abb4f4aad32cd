// SPDX-License-Identifier: Apache-2.0
#include "common/target/csv_line.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
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

std::string_view TakeField(std::string_view* rest) {
  const size_t end = std::min(rest->find(';'), rest->size());
  const absl::string_view field = absl::StripAsciiWhitespace({rest->data(), end});
  rest->remove_prefix(std::min(end + 1, rest->size()));
  return {field.data(), field.size()};
}

std::optional<CsvLineFault> ParseTime(std::string_view field, int64_t* time_ns) {
  const char* end = field.data() + field.size();
  const auto [stopped, error] = std::from_chars(field.data(), end, *time_ns);
  if (error == std::errc::result_out_of_range) {
    return CsvLineFault{
        RefusalReason::kCsvBadTime,
        absl::StrCat("timestamp ", Quoted(field), " does not fit 64 bits of nanoseconds")};
  }
  const auto is_zero = [](char c) { return c == '0'; };
  const bool whole =
      error == std::errc() &&
      (stopped == end || (*stopped == '.' && std::all_of(stopped + 1, end, is_zero)));
  if (!whole) {
    return CsvLineFault{
        RefusalReason::kCsvBadTime,
        absl::StrCat("timestamp ", Quoted(field), " is not a whole number of nanoseconds")};
  }
  return std::nullopt;
}

std::optional<CsvLineFault> ParseCoordinate(std::string_view field, int marker, char axis,
                                            double* value_px) {
  const char* end = field.data() + field.size();
  const auto [stopped, error] = std::from_chars(field.data(), end, *value_px);
  const bool is_number = stopped == end && error != std::errc::invalid_argument;
  if (!is_number) {
    return CsvLineFault{
        RefusalReason::kCsvNotANumber,
        absl::StrCat(std::string(1, axis), marker, " is ", Quoted(field), ", not a number")};
  }
  if (error == std::errc::result_out_of_range || !std::isfinite(*value_px)) {
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

int CsvFieldCount(std::string_view line) {
  return 1 + static_cast<int>(std::count(line.begin(), line.end(), ';'));
}

std::optional<CsvLineFault> ParseCsvLine(std::string_view line, int marker_count, double sigma_px,
                                         Observation* observation) {
  const int field_count = CsvFieldCount(line);
  if (field_count != 1 + 2 * marker_count) {
    return CsvLineFault{
        RefusalReason::kCsvFieldCount,
        absl::StrCat(field_count, field_count == 1 ? " field" : " fields", " instead of ",
                     1 + 2 * marker_count, " (timestamp and x;y of ", marker_count, " markers)")};
  }
  std::string_view rest = line;
  if (auto fault = ParseTime(TakeField(&rest), &observation->time_ns)) return fault;

  observation->markers.assign(static_cast<size_t>(marker_count), MarkerObservation{});
  for (int index = 0; index < marker_count; ++index) {
    double x_px = 0;
    double y_px = 0;
    if (auto fault = ParseCoordinate(TakeField(&rest), index, 'x', &x_px)) return fault;
    if (auto fault = ParseCoordinate(TakeField(&rest), index, 'y', &y_px)) return fault;
    const bool x_seen = x_px != kNotSeen;
    const bool y_seen = y_px != kNotSeen;
    if (x_seen != y_seen) {
      return CsvLineFault{RefusalReason::kCsvHalfMarker,
                          absl::StrCat("marker ", index, " has only one of x and y (", x_px, ", ",
                                       y_px, "); a marker that was not seen is -1;-1")};
    }
    if (!x_seen) continue;
    MarkerObservation& marker = observation->markers[static_cast<size_t>(index)];
    marker.visible = true;
    marker.centre_px = {x_px, y_px};
    marker.covariance_px2 = Eigen::Matrix2d::Identity() * (sigma_px * sigma_px);
    marker.centre_kind = CentreKind::kImageBlob;
  }
  return std::nullopt;
}

}  // namespace rigcal
