// SPDX-License-Identifier: Apache-2.0
#include "agent/command/marker_csv.h"

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
  return line + "\n";
}

}  // namespace rigcal::agent
