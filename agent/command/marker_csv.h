// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"
#include "agent/event_files/event_file_writer.h"
#include "common/target/observation.h"

namespace rigcal::agent {

// `timestamp_ns;x0;y0;x1;y1;...` in pixels without the end of the line; -1;-1 for a marker that is
// not seen. What csv: reads.
std::string MarkerCsvLine(const Observation& observation);
// Such a line with its end.
absl::Status WriteMarkerCsv(const Observation& observation, OutputFile* file);

}  // namespace rigcal::agent
