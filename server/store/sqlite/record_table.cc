// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/record_table.h"

namespace rigcal::server {
namespace {

struct OrderSql {
  const char* by;
  const char* after;  // condition for rows after a position
};

OrderSql SqlOf(RecordOrder order) {
  switch (order) {
    case RecordOrder::kNewestFirst:
      return {"number DESC", "number<?"};
    case RecordOrder::kOldestFirst:
      return {"number", "number>?"};
    case RecordOrder::kIdAscending:
      return {"id", "id>?"};
    case RecordOrder::kIdDescending:
      return {"id DESC", "id<?"};
  }
  return {"number DESC", "number<?"};
}

}  // namespace

SQLite::Statement SelectRecords(SQLite::Database& database, const char* table,
                                std::vector<RecordCondition> conditions, const ListPage& page) {
  const OrderSql order = SqlOf(page.order);
  if (page.after) {
    if (page.order == RecordOrder::kNewestFirst || page.order == RecordOrder::kOldestFirst) {
      conditions.push_back({order.after, page.after->time});
    } else {
      conditions.push_back({order.after, std::string_view(page.after->id)});
    }
  }
  std::string sql = absl::StrCat("SELECT id, body, checksum, number FROM ", table);
  for (size_t i = 0; i < conditions.size(); ++i) {
    absl::StrAppend(&sql, i == 0 ? " WHERE " : " AND ", conditions[i].sql);
  }
  absl::StrAppend(&sql, " ORDER BY ", order.by, " LIMIT ", page.limit);
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
