// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/record_list.h"
#include "server/store/sqlite/record_checksum.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {

// The tables of whole records, `session` and `calibration`: number (grows with each record), id,
// rig, body and checksum. Messages call a record by its table's name. Throw SQLite::Exception.

// A condition of a query, with the value of its `?`.
struct RecordCondition {
  std::string sql;
  std::variant<int64_t, std::string_view> value;
};

// The rows (id, body, checksum, number) of `table` that meet the conditions and are on the page.
SQLite::Statement SelectRecords(SQLite::Database& database, const char* table,
                                std::vector<RecordCondition> conditions, const ListPage& page);

// NOT_FOUND: "no session s-000001".
absl::Status NoRecord(const char* table, std::string_view id);

// The record of a row that begins with id, body and checksum; DATA_LOSS where it is damaged.
// `parse` reads the body.
template <typename Record>
absl::StatusOr<Record> ParseRecord(SQLite::Statement& row, const char* table,
                                   absl::StatusOr<Record> (*parse)(std::string_view body)) {
  const std::string name = absl::StrCat("the record of ", table, " ", row.getColumn(0).getString());
  const std::string_view body = ColumnBytes(row, 1);
  if (Checksum(body) != ColumnUint32(row, 2)) {
    return absl::DataLossError(absl::StrCat(name, " is damaged: its checksum is wrong"));
  }
  absl::StatusOr<Record> record = parse(body);
  if (record.ok()) return record;
  return absl::DataLossError(
      absl::StrCat(name, " cannot be read: ", std::string(record.status().message())));
}

template <typename Record>
absl::StatusOr<Record> FindRecord(SQLite::Database& database, const char* table,
                                  std::string_view id,
                                  absl::StatusOr<Record> (*parse)(std::string_view body)) {
  SQLite::Statement row =
      Query(database, absl::StrCat("SELECT id, body, checksum FROM ", table, " WHERE id=?"), id);
  if (!row.executeStep()) return NoRecord(table, id);
  return ParseRecord(row, table, parse);
}

template <typename Record>
absl::StatusOr<std::vector<Listed<Record>>> ListRecords(
    SQLite::Database& database, const char* table, std::vector<RecordCondition> conditions,
    const ListPage& page, absl::StatusOr<Record> (*parse)(std::string_view body)) {
  SQLite::Statement row = SelectRecords(database, table, std::move(conditions), page);
  std::vector<Listed<Record>> records;
  while (row.executeStep()) {
    RIGCAL_ASSIGN_OR_RETURN(Record record, ParseRecord(row, table, parse));
    records.push_back({std::move(record),
                       {.time = row.getColumn(3).getInt64(), .id = row.getColumn(0).getString()}});
  }
  return records;
}

}  // namespace rigcal::server
