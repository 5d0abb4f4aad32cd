// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/record_table.h"

namespace rigcal::server {

SQLite::Statement SelectRecords(SQLite::Database& database, const char* table,
                                std::vector<RecordCondition> conditions, const ListPage& page) {
  const bool by_number =
      page.order == RecordOrder::kNewestFirst || page.order == RecordOrder::kOldestFirst;
  const bool descending =
      page.order == RecordOrder::kNewestFirst || page.order == RecordOrder::kIdDescending;
  const std::string column = by_number ? "number" : "id";
  if (page.after) {
    conditions.push_back({column + (descending ? "<?" : ">?"), std::string_view(page.after->id)});
    if (by_number) conditions.back().value = page.after->time;
  }
  std::string sql = absl::StrCat("SELECT id, body, checksum, number FROM ", table);
  for (size_t i = 0; i < conditions.size(); ++i) {
    absl::StrAppend(&sql, i == 0 ? " WHERE " : " AND ", conditions[i].sql);
  }
  absl::StrAppend(&sql, " ORDER BY ", column, descending ? " DESC" : "", " LIMIT ", page.limit);
  SQLite::Statement query(database, sql);
  int index = 0;
  for (const RecordCondition& condition : conditions) {
    std::visit([&](auto value) { BindValue(query, ++index, value); }, condition.value);
  }
  return query;
}

absl::Status NoRecord(const char* table, std::string_view id) {
  return absl::NotFoundError(absl::StrCat("no ", table, " ", std::string(id)));
}

}  // namespace rigcal::server
