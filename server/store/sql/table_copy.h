// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {

// A table that was copied or read.
struct CopiedTable {
  std::string name;
  uint64_t rows = 0;
  uint32_t digest = 0;  // CRC-32 of all its values in the order of its key
};

// FAILED_PRECONDITION: there are sessions, calibrations, or traces of deleted ones.
absl::Status CheckTablesAreEmpty(SqlDatabase& database);

// Reads every row of `from` into `to`, which has none; replaces the identity of `to`. Both inside a
// transaction of the caller's. May throw the database's errors.
std::vector<CopiedTable> CopyTables(SqlDatabase& from, SqlDatabase& to);

// The same without a destination.
std::vector<CopiedTable> DigestTables(SqlDatabase& database);

// DATA_LOSS names the first table that differs.
absl::Status CompareCopies(const std::vector<CopiedTable>& source,
                           const std::vector<CopiedTable>& copy);

}  // namespace rigcal::server
