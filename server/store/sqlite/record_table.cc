// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/record_table.h"

#include <string>

#include "server/store/sqlite/sqlite_connection.h"

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

absl::Status ForEachRecord(
    SQLite::Database& database, const char* table, std::vector<RecordCondition> conditions,
    const ListPage& page,
    absl::FunctionRef<absl::Status(SQLite::Statement& row, RecordPosition position)> visit) {
  if (page.limit < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("limit is ", page.limit, "; at least 1 is needed"));
  }
  const OrderSql order = SqlOf(page.order);
  if (page.after) {
    const bool by_time =
        page.order == RecordOrder::kNewestFirst || page.order == RecordOrder::kOldestFirst;
    if (by_time) {
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
  for (size_t i = 0; i < conditions.size(); ++i) {
    const int index = static_cast<int>(i) + 1;
    if (const auto* number = std::get_if<int64_t>(&conditions[i].value)) {
      query.bind(index, *number);
    } else {
      BindText(query, index, std::get<std::string_view>(conditions[i].value));
    }
  }
  while (query.executeStep()) {
    RIGCAL_RETURN_IF_ERROR(visit(
        query, {.time = query.getColumn(3).getInt64(), .id = query.getColumn(0).getString()}));
  }
  return absl::OkStatus();
}

}  // namespace rigcal::server
