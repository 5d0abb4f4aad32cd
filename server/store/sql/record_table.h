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
#include "server/store/record_checksum.h"
#include "server/store/record_list.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {

// The tables of whole records, `session` and `calibration`: number (grows with each record), id,
// rig, state, body and checksum; and beside each `session_summary` and `calibration_summary` with
// what lists show. Messages call a record by its table's name. Throw the database's errors.

// A condition of a query, with the value of its `?`.
struct RecordCondition {
  std::string sql;
  std::variant<int64_t, std::string_view> value;
};

// Rows (id, summary's body, summary's checksum, number, rig, state, size of the body, `more`) of
// the records that meet the conditions and are on the page.
SqlStatement SelectSummaries(SqlDatabase& database, const char* table, const char* more,
                             std::vector<RecordCondition> conditions, const ListPage& page);

// Adds or replaces the summary of a record.
void PutSummary(SqlDatabase& database, const char* table, int64_t number, std::string_view body);

// NOT_FOUND: "no session s-000001".
absl::Status NoRecord(const char* table, std::string_view id);

// OK, or DATA_LOSS that names the record and says what to do.
absl::Status CheckRecord(const char* table, std::string_view id, std::string_view body,
                         uint32_t checksum);
absl::Status UnreadableRecord(const char* table, std::string_view id, const absl::Status& why);

// The record of a row that begins with id, body and checksum; DATA_LOSS where it is damaged.
// `parse` reads the body.
template <typename Record>
absl::StatusOr<Record> ParseRecord(SqlStatement& row, const char* table,
                                   absl::StatusOr<Record> (*parse)(std::string_view body)) {
  const std::string id = row.Text(0);
  const std::string_view body = row.Bytes(1);
  RIGCAL_RETURN_IF_ERROR(CheckRecord(table, id, body, row.Uint32(2)));
  absl::StatusOr<Record> record = parse(body);
  if (record.ok()) return record;
  return UnreadableRecord(table, id, record.status());
}

template <typename Record>
absl::StatusOr<Record> FindRecord(SqlDatabase& database, const char* table, std::string_view id,
                                  absl::StatusOr<Record> (*parse)(std::string_view body)) {
  SqlStatement row =
      Query(database, absl::StrCat("SELECT id, body, checksum FROM ", table, " WHERE id=?"), id);
  if (!row.Step()) return NoRecord(table, id);
  return ParseRecord(row, table, parse);
}

// Checks the records that lists show, as far as a list may take its time.
class RecordVerifier {
 public:
  RecordVerifier(SqlDatabase& database, const char* table) : database_(database), table_(table) {}

  // Of a record with `body_size` bytes: OK, or its damage. OK without a look when the records
  // looked at so far were many bytes.
  absl::Status Verify(std::string_view id, int64_t number, int64_t body_size);

 private:
  SqlDatabase& database_;
  const char* const table_;
  int64_t verified_bytes_ = 0;
};

// How a list gets its entries.
template <typename Summary>
struct SummarySource {
  const char* table;
  const char* more;  // a column for `blank`
  absl::StatusOr<Summary> (*parse)(std::string_view body);
  // From the record itself, where it has no summary that can be read.
  absl::StatusOr<Summary> (*summarize)(SqlDatabase& database, std::string_view id);
  // With what the columns of SelectSummaries say, for a record that is damaged.
  Summary (*blank)(SqlStatement& row);
};

template <typename Summary>
std::vector<Listed<Summary>> ListSummaries(SqlDatabase& database,
                                           const SummarySource<Summary>& source,
                                           std::vector<RecordCondition> conditions,
                                           const ListPage& page) {
  SqlStatement row =
      SelectSummaries(database, source.table, source.more, std::move(conditions), page);
  RecordVerifier verifier(database, source.table);
  std::vector<Listed<Summary>> summaries;
  while (row.Step()) {
    const std::string id = row.Text(0);
    const int64_t number = row.Int64(3);
    absl::StatusOr<Summary> summary = absl::NotFoundError("");
    if (!row.IsNull(1)) summary = ParseRecord(row, source.table, source.parse);
    absl::Status damage;
    if (summary.ok()) {
      damage = verifier.Verify(id, number, row.Int64(6));
    } else {
      summary = source.summarize(database, id);
      damage = summary.status();
    }
    if (!summary.ok()) summary = source.blank(row);
    summary->damage = std::string(damage.message());
    summaries.push_back({*std::move(summary), {.time = number, .id = id}});
  }
  return summaries;
}

}  // namespace rigcal::server
