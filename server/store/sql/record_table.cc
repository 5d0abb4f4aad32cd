// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/record_table.h"

namespace rigcal::server {
namespace {

// A list checks this many bytes of records: some milliseconds.
constexpr int64_t kVerifyBytes = 8 << 20;

}  // namespace

SqlStatement SelectSummaries(SqlDatabase& database, const char* table, const char* more,
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
  std::string sql =
      absl::StrCat("SELECT id, s.body, s.checksum, number, rig, state, length(r.body), ", more,
                   " FROM ", table, " r LEFT JOIN ", table, "_summary s ON record_number=number");
  for (size_t i = 0; i < conditions.size(); ++i) {
    absl::StrAppend(&sql, i == 0 ? " WHERE " : " AND ", conditions[i].sql);
  }
  absl::StrAppend(&sql, " ORDER BY ", column, descending ? " DESC" : "", " LIMIT ", page.limit);
  SqlStatement query(database, sql);
  int index = 0;
  for (const RecordCondition& condition : conditions) {
    std::visit([&](auto value) { query.Bind(++index, value); }, condition.value);
  }
  return query;
}

void PutSummary(SqlDatabase& database, const char* table, int64_t number, std::string_view body) {
  Query(database,
        absl::StrCat(
            "INSERT INTO ", table,
            "_summary(record_number, body, checksum) VALUES(?,?,?) ON CONFLICT(record_number) "
            "DO UPDATE SET body=excluded.body, checksum=excluded.checksum"),
        number, Blob{body}, Checksum(body))
      .Run();
}

absl::Status NoRecord(const char* table, std::string_view id) {
  return absl::NotFoundError(absl::StrCat("no ", table, " ", std::string(id)));
}

absl::Status CheckRecord(const char* table, std::string_view id, std::string_view body,
                         uint32_t checksum) {
  if (Checksum(body) == checksum) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat("the record of ", table, " ", std::string(id),
                   " is damaged: its checksum is wrong; restore a backup, or delete it"));
}

absl::Status UnreadableRecord(const char* table, std::string_view id, const absl::Status& why) {
  return absl::DataLossError(absl::StrCat("the record of ", table, " ", std::string(id),
                                          " cannot be read: ", std::string(why.message()),
                                          "; restore a backup, or delete it"));
}

absl::Status RecordVerifier::Verify(std::string_view id, int64_t number, int64_t body_size) {
  if (verified_bytes_ + body_size > kVerifyBytes) return absl::OkStatus();
  verified_bytes_ += body_size;
  SqlStatement row = Query(
      database_, absl::StrCat("SELECT body, checksum FROM ", table_, " WHERE number=?"), number);
  if (!row.Step()) return absl::OkStatus();
  return CheckRecord(table_, id, row.Bytes(0), row.Uint32(1));
}

}  // namespace rigcal::server
