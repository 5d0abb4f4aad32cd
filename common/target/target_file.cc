// SPDX-License-Identifier: Apache-2.0
#include "common/target/target_file.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"
#include "common/text/line_reader.h"

namespace rigcal {
namespace {

constexpr char kExampleLine[] = "A1 0.03 0.06 0 0.0002";

absl::Status PointFault(std::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(std::string(what),
                                                 "; a right line is: ", kExampleLine,
                                                 " (label, x, y, z and one sigma, in metres)"));
}

}  // namespace

absl::StatusOr<GivenPoint> ParseTargetPoint(std::string_view text, PointLines lines) {
  const std::vector<std::string> words =
      absl::StrSplit(std::string(text), absl::ByAnyChar(", \t"), absl::SkipEmpty());
  const bool is_label = lines == PointLines::kMayBeLabels && words.size() == 1;
  if (!is_label && words.size() != 4 && words.size() != 5) {
    return PointFault(absl::StrCat("has ", words.size(), " values, 4 or 5 are needed",
                                   lines == PointLines::kMayBeLabels ? ", or a label alone" : ""));
  }
  TargetPoint point;
  point.label = words[0];
  if (is_label) return GivenPoint{std::move(point), false};
  point.sigma_m = kDefaultPointSigmaM;
  double* const values[] = {&point.x_m, &point.y_m, &point.z_m, &point.sigma_m};
  for (size_t i = 1; i < words.size(); ++i) {
    if (absl::SimpleAtod(words[i], values[i - 1]) && std::isfinite(*values[i - 1])) continue;
    return PointFault(
        absl::StrCat("\"", absl::CHexEscape(words[i].substr(0, 64)), "\" is not a finite number"));
  }
  return GivenPoint{std::move(point), true};
}

absl::StatusOr<std::vector<GivenPoint>> ReadTargetFile(const std::string& path, PointLines lines) {
  RIGCAL_ASSIGN_OR_RETURN(agent::LineReader reader, agent::LineReader::Open(path));
  std::vector<GivenPoint> points;
  std::map<std::string, uint64_t> line_of_label;
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<agent::LineReader::Line> line, reader.Next());
    if (!line) break;
    const auto fault = [&](const std::string& what) {
      return absl::InvalidArgumentError(absl::StrCat(path, ", line ", line->number, ": ", what));
    };
    if (line->too_long) return fault("is too long");
    const std::string_view text = line->text.substr(0, line->text.find('#'));
    if (text.find_first_not_of(", \t") == std::string_view::npos) continue;
    if (points.size() == kMaxMarkers) {
      return fault(absl::StrCat("a target has at most ", kMaxMarkers, " points"));
    }
    absl::StatusOr<GivenPoint> given = ParseTargetPoint(text, lines);
    if (!given.ok()) return fault(std::string(given.status().message()));
    const TargetPoint& point = given->point;
    const auto [known, is_new] = line_of_label.try_emplace(point.label, line->number);
    if (!is_new) {
      return fault(absl::StrCat("label ", absl::CHexEscape(point.label.substr(0, 64)),
                                " is in line ", known->second, " too: give each point its own"));
    }
    if (const std::string why = TargetPointFault(point); !why.empty()) return fault(why);
    points.push_back(*std::move(given));
  }
  return points;
}

}  // namespace rigcal
