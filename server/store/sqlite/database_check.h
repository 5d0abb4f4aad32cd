// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "absl/status/statusor.h"
#include "server/store/sql/table_check.h"

namespace rigcal::server {

// CheckTables of the database `file`, and SQLite's own check of its structure. Only reads, in one
// consistent state: a server may run on it. Faults in the data are in the report, not in the
// status.
//   NOT_FOUND            there is no such file
//   FAILED_PRECONDITION  it is a database of another program or version
//   DATA_LOSS            so damaged that it cannot be opened
absl::StatusOr<DatabaseReport> CheckDatabase(const std::filesystem::path& file,
                                             const CareProgress& progress);

}  // namespace rigcal::server
