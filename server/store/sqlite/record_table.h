// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <string_view>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/sqlite/record_checksum.h"

namespace rigcal::server {

// The tables of whole records, `session` and `calibration`: number (grows with each record), id,
// rig, body and checksum. Messages call a record by its table's name. Throw SQLite::Exception.

// Which records, the newest first.
struct RecordPage {
  const char* table;
  std::string_view rig;     // empty: of every rig
  int limit;                // at least 1
  std::string_view before;  // an id: those older than this one; empty: from the newest on
};

// Calls `visit` with rows of (id, body, checksum), until it returns an error, which is returned.
// INVALID_ARGUMENT: the limit. `number_of` finds the number of an id.
absl::Status ForEachRecord(SQLite::Database& database, const RecordPage& page,
                           absl::FunctionRef<absl::StatusOr<int64_t>(std::string_view)> number_of,
                           absl::FunctionRef<absl::Status(SQLite::Statement& row)> visit);

// The record of such a row; DATA_LOSS where it is damaged. `parse` reads the body.
template <typename Record>
absl::StatusOr<Record> ParseRecord(SQLite::Statement& row, const char* table,
                                   absl::StatusOr<Record> (*parse)(std::string_view body)) {
  const std::string name = absl::StrCat(table, " ", row.getColumn(0).getString());
  RIGCAL_ASSIGN_OR_RETURN(const std::string_view body, CheckedBody(row, 1, name));
  absl::StatusOr<Record> record = parse(body);
  if (record.ok()) return record;
  return absl::DataLossError(absl::StrCat(
      "the record of ", name, " cannot be read: ", std::string(record.status().message())));
}

}  // namespace rigcal::server
