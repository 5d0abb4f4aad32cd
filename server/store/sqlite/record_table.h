// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <string_view>
#include <variant>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/record_list.h"
#include "server/store/sqlite/record_checksum.h"

namespace rigcal::server {

// The tables of whole records, `session` and `calibration`: number (grows with each record), id,
// rig, body and checksum. Messages call a record by its table's name. Throw SQLite::Exception.

// A condition of a query, with the value of its `?`.
struct RecordCondition {
  const char* sql;
  std::variant<int64_t, std::string_view> value;
};

// Calls `visit` with the rows (id, body, checksum, number) of `table` that meet the conditions,
// until it returns an error, which is returned. INVALID_ARGUMENT: the limit.
absl::Status ForEachRecord(
    SQLite::Database& database, const char* table, std::vector<RecordCondition> conditions,
    const ListPage& page,
    absl::FunctionRef<absl::Status(SQLite::Statement& row, RecordPosition position)> visit);

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
