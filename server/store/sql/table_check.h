// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/store/sql/sql_database.h"

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

// Checks every checksum in the tables, and that the counts of every camera and the position of
// every stream agree with what is stored; adds to `report`, which may have faults of the structure.
// Only reads; `database` is in one consistent state. What fails to be read is a fault in the
// report.
void CheckTables(SqlDatabase& database, const CareProgress& progress, DatabaseReport* report);

}  // namespace rigcal::server
