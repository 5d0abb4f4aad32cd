// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fstream>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/target/observation.h"

namespace rigcal::agent {

// `timestamp_ns;x0;y0;x1;y1;...` in pixels without the end of the line; -1;-1 for a marker that is
// not seen. What csv: reads.
std::string MarkerCsvLine(const Observation& observation);

// Such lines in a file, one per frame, in their order.
class MarkerCsvWriter {
 public:
  // PERMISSION_DENIED: the file cannot be written.
  static absl::StatusOr<MarkerCsvWriter> Create(const std::string& path);
  void Write(const Observation& observation) { stream_ << MarkerCsvLine(observation) << '\n'; }
  // DATA_LOSS: not everything is in the file (the disk is full).
  absl::Status Close();

 private:
  MarkerCsvWriter(std::string path, std::ofstream stream)
      : path_(std::move(path)), stream_(std::move(stream)) {}
  std::string path_;
  std::ofstream stream_;
};

}  // namespace rigcal::agent
