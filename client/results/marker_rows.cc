// SPDX-License-Identifier: Apache-2.0
#include "client/results/marker_rows.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/quantities.h"
#include "common/status/status_macros.h"
#include "common/target/csv_line.h"
#include "common/text/line_reader.h"

namespace rigcal::client {
namespace {

namespace fs = std::filesystem;

bool IsRowFile(const fs::path& file) {
  return absl::AsciiStrToLower(file.extension().string()) == ".csv";
}

constexpr double kUnusedSigmaPx = 1;  // set anew by whoever triangulates

struct RowFile {
  std::vector<Observation> rows;
  int marker_count = 0;
};

// <camera>.csv, or with another ending in capitals (.CSV); as the first one where there is none.
fs::path RowPath(const fs::path& folder, const std::string& camera) {
  const fs::path usual = folder / (camera + ".csv");
  std::error_code error;
  if (fs::exists(usual, error)) return usual;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const fs::path& file = entry.path();
    if (file.stem() == camera && IsRowFile(file)) return file;
  }
  return usual;
}

// Lines left out, by reason, with the first of each.
struct LeftOut {
  uint32_t count = 0;
  std::string example;
};

absl::StatusOr<RowFile> ReadRowFile(const std::string& path, std::vector<std::string>* warnings) {
  RIGCAL_ASSIGN_OR_RETURN(const CsvLayout layout, FindCsvLayoutOfFile(path));
  RIGCAL_ASSIGN_OR_RETURN(agent::LineReader reader, agent::LineReader::Open(path));
  RowFile file;
  file.marker_count = static_cast<int>(layout.markers.size());
  bool is_header = layout.has_header;
  std::map<std::string, LeftOut> left_out;
  const auto leave_out = [&](const std::string& reason, uint64_t line, const std::string& what) {
    LeftOut& entry = left_out[reason];
    if (entry.count++ == 0) entry.example = absl::StrCat("line ", line, ": ", what);
  };
  for (;;) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<agent::LineReader::Line> line, reader.Next());
    if (!line) break;
    if (line->text.find_first_not_of(" \t\r") == line->text.npos) continue;
    if (line->too_long) {
      leave_out("too long", line->number, "more than 8192 bytes");
      continue;
    }
    if (std::exchange(is_header, false)) continue;
    Observation row;
    if (const auto fault = ParseCsvLine(line->text, layout, kUnusedSigmaPx, &row)) {
      leave_out("unreadable", line->number, fault->what);
      continue;
    }
    if (!file.rows.empty() && row.time_ns <= file.rows.back().time_ns) {
      leave_out("not after the row before", line->number,
                "the clock steps back, or a row comes twice");
      continue;
    }
    file.rows.push_back(std::move(row));
  }
  for (const auto& [reason, entry] : left_out) {
    warnings->push_back(absl::StrCat(path, ": ", FormatCount(entry.count, "row"),
                                     " left out: ", reason, " (", entry.example, ")"));
  }
  return file;
}

}  // namespace

absl::StatusOr<MarkerRows> ReadMarkerRows(const std::string& folder,
                                          const std::vector<std::string>& cameras) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    return absl::NotFoundError(absl::StrCat("there is no folder ", folder,
                                            "; rows of markers are in <camera>.csv of a folder"));
  }
  MarkerRows result;
  int marker_count = 0;
  std::string first;
  for (const std::string& camera : cameras) {
    const fs::path path = RowPath(folder, camera);
    if (!fs::exists(path, error)) {
      result.warnings.push_back(absl::StrCat("camera ", camera, ": there is no ", path.string()));
      continue;
    }
    RIGCAL_ASSIGN_OR_RETURN(RowFile file, ReadRowFile(path.string(), &result.warnings));
    if (file.rows.empty()) {
      result.warnings.push_back(absl::StrCat("camera ", camera, ": ", path.string(), " is empty"));
      continue;
    }
    if (marker_count == 0) marker_count = file.marker_count, first = camera;
    if (file.marker_count != marker_count) {
      return absl::InvalidArgumentError(absl::StrCat(
          "camera ", camera, " has ", file.marker_count, " markers in a row and ", first, " has ",
          marker_count, ": the rows of all cameras must name the same markers in one order"));
    }
    result.cameras.push_back({camera, std::move(file.rows)});
  }
  std::vector<std::string> others;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const fs::path file = entry.path();
    const std::string stem = file.stem().string();
    if (!IsRowFile(file) || stem.empty() || stem.front() == '.') continue;
    if (std::ranges::find(cameras, stem) == cameras.end()) others.push_back(stem);
  }
  std::ranges::sort(others);
  if (!others.empty()) {
    result.warnings.push_back(
        absl::StrCat("not in the calibration, and left out: ", absl::StrJoin(others, ", ")));
  }
  if (result.cameras.size() < 2) {
    return absl::InvalidArgumentError(absl::StrCat(
        folder, " has rows of ", result.cameras.empty() ? "none" : result.cameras[0].camera,
        " of the calibration's cameras (", absl::StrJoin(cameras, ", "), ")",
        others.empty() ? "" : absl::StrCat(" and of others (", absl::StrJoin(others, ", "), ")"),
        ", and a point needs two. A file is named after its camera; of images, video and events "
        "rigcal-agent detect makes such rows"));
  }
  return result;
}

}  // namespace rigcal::client
