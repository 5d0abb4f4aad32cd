// SPDX-License-Identifier: Apache-2.0
#include "agent/command/marker_csv.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::agent {

std::string MarkerCsvLine(const Observation& observation) {
  std::string line = absl::StrCat(observation.time_ns);
  for (const MarkerObservation& marker : observation.markers) {
    if (marker.visible) {
      absl::StrAppendFormat(&line, ";%.5f;%.5f", marker.centre_px.x(), marker.centre_px.y());
    } else {
      absl::StrAppend(&line, ";-1;-1");
    }
  }
  return line;
}

absl::StatusOr<MarkerCsvWriter> MarkerCsvWriter::Create(const std::string& path) {
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  if (!stream) return absl::PermissionDeniedError(absl::StrCat("cannot write ", path));
  return MarkerCsvWriter(path, std::move(stream));
}

absl::Status MarkerCsvWriter::Close() {
  stream_.close();
  if (stream_) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat("not everything is in ", path_, "; is the disk full?"));
}

}  // namespace rigcal::agent
