// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::server {

// Gets the part that is done, 0 to 1.
using CareProgress = std::function<void(double)>;

// What a check of a database has found.
struct DatabaseReport {
  uint64_t session_count = 0;
  uint64_t calibration_count = 0;
  uint64_t batch_count = 0;
  uint64_t observation_count = 0;  // that can be read
  uint64_t damaged_row_count = 0;  // observations in damaged batches
  uint64_t fault_count = 0;
  std::vector<std::string> faults;  // the first of them, each a sentence

  void AddFault(std::string fault);
};

// Checks every checksum in the database `file`, its structure, and that the counts of every camera
// and the position of every stream agree with what is stored. Only reads, in one consistent state:
// a server may run on it. Faults in the data are in the report, not in the status.
//   NOT_FOUND            there is no such file
//   FAILED_PRECONDITION  it is a database of another program or version
//   DATA_LOSS            so damaged that it cannot be opened
absl::StatusOr<DatabaseReport> CheckDatabase(const std::filesystem::path& file,
                                             const CareProgress& progress);

}  // namespace rigcal::server
