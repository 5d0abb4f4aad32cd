// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/recorded_tracks.h"

#include <algorithm>
#include <fstream>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/import/intrinsics_file.h"
#include "common/status/status_macros.h"

namespace rigcal::testing {
namespace {

absl::StatusOr<Observation> ParseRow(const std::string& line, double sigma_px) {
  const std::vector<std::string> fields = absl::StrSplit(line, ';');
  Observation row;
  if (fields.size() % 2 != 1 || !absl::SimpleAtoi(fields[0], &row.time_ns)) {
    return absl::InvalidArgumentError(absl::StrCat("malformed row: ", line));
  }
  for (size_t i = 1; i < fields.size(); i += 2) {
    MarkerObservation marker;
    double x = 0, y = 0;
    if (!absl::SimpleAtod(fields[i], &x) || !absl::SimpleAtod(fields[i + 1], &y)) {
      return absl::InvalidArgumentError(absl::StrCat("malformed row: ", line));
    }
    marker.visible = x != -1 && y != -1;
    if (marker.visible) {
      marker.centre_px = {x, y};
      marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    }
    row.markers.push_back(marker);
  }
  return row;
}

}  // namespace

absl::StatusOr<std::vector<RecordedCamera>> LoadRecordedTracks(const std::filesystem::path& folder,
                                                               double sigma_px) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".csv") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<RecordedCamera> cameras;
  for (const std::filesystem::path& file : files) {
    RecordedCamera camera;
    camera.description.camera = file.stem().string();
    camera.description.clock = {camera.description.camera, "recording"};
    camera.description.source = absl::StrCat("csv:", file.filename().string());
    std::filesystem::path yaml = file;
    RIGCAL_ASSIGN_OR_RETURN(const IntrinsicsFile intrinsics,
                            ReadIntrinsicsFile(yaml.replace_extension(".yaml").string()));
    camera.description.image_size_px = intrinsics.image_size_px;
    camera.description.intrinsics = intrinsics.intrinsics;
    std::ifstream stream(file);
    std::string line;
    ClockEpochCounter epochs;
    while (std::getline(stream, line)) {
      if (line.empty()) continue;
      RIGCAL_ASSIGN_OR_RETURN(Observation row, ParseRow(line, sigma_px));
      row.clock_epoch = epochs.EpochOf(row.time_ns);
      camera.observations.push_back(std::move(row));
    }
    cameras.push_back(std::move(camera));
  }
  if (cameras.empty()) {
    return absl::NotFoundError(absl::StrCat("no .csv in ", folder.string()));
  }
  return cameras;
}

}  // namespace rigcal::testing
