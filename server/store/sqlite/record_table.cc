// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/record_table.h"

#include <limits>

#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {

absl::Status ForEachRecord(SQLite::Database& database, const RecordPage& page,
                           absl::FunctionRef<absl::StatusOr<int64_t>(std::string_view)> number_of,
                           absl::FunctionRef<absl::Status(SQLite::Statement& row)> visit) {
  if (page.limit < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("limit is ", page.limit, "; at least 1 is needed"));
  }
  int64_t before_number = std::numeric_limits<int64_t>::max();
  if (!page.before.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(before_number, number_of(page.before));
  }
  SQLite::Statement query(
      database,
      absl::StrCat("SELECT id, body, checksum FROM ", page.table, " WHERE number<?1",
                   page.rig.empty() ? "" : " AND rig=?3", " ORDER BY number DESC LIMIT ?2"));
  query.bind(1, before_number);
  query.bind(2, page.limit);
  if (!page.rig.empty()) BindText(query, 3, page.rig);
  while (query.executeStep()) RIGCAL_RETURN_IF_ERROR(visit(query));
  return absl::OkStatus();
}

}  // namespace rigcal::server
