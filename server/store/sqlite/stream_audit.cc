// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "common/status/status_macros.h"
#include "server/store/report_counts.h"
#include "server/store/sqlite/session_table.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {
namespace {

void CountStoredRows(SQLite::Database& database, int64_t stream_id, StreamAudit* audit) {
  SQLite::Statement query =
      Query(database,
            "SELECT coalesce(sum(row_count), 0), coalesce(max((id & 0xffffffff) + row_count), 1) "
            "FROM batch WHERE id BETWEEN ?1<<32 AND (?1<<32)+0xffffffff",
            stream_id);
  if (!query.executeStep()) return;
  audit->stored_count = ColumnUint64(query, 0);
  audit->highest_seq = std::max(audit->highest_seq, ColumnUint32(query, 1) - 1);
}

void CountDropped(SQLite::Database& database, int64_t stream_id, StreamAudit* audit) {
  SQLite::Statement query =
      Query(database,
            "SELECT reason, sum(seq_count), max(first_seq+seq_count) FROM dropped "
            "WHERE stream_id=? GROUP BY reason ORDER BY reason",
            stream_id);
  RefusalCounter counter;
  while (query.executeStep()) {
    counter.Add("", RefusalReasonFromName(query.getColumn(0).getString()), ColumnUint64(query, 1));
    audit->highest_seq = std::max(audit->highest_seq, ColumnUint32(query, 2) - 1);
  }
  audit->dropped = counter.List();
}

void AddReported(SQLite::Database& database, int64_t stream_id, StreamAudit* audit) {
  SQLite::Statement query = Query(
      database, "SELECT name, count FROM report_count WHERE stream_id=? ORDER BY name", stream_id);
  SpoolReport reported;
  while (query.executeStep()) {
    if (SetNamedCount(query.getColumn(0).getString(), ColumnUint64(query, 1), &reported)) {
      audit->reported = reported;
    }
  }
}

}  // namespace

absl::StatusOr<std::vector<StreamAudit>> ReadStreamAudits(SQLite::Database& database,
                                                          std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  SQLite::Statement query =
      Query(database,
            "SELECT s.id, c.camera, s.stream_epoch, s.durable_seq, s.last_seq FROM stream s "
            "JOIN session_camera c ON s.camera_id=c.id WHERE c.session_number=? "
            "ORDER BY c.camera, s.stream_epoch",
            number);
  std::vector<StreamAudit> audits;
  while (query.executeStep()) {
    const int64_t stream_id = query.getColumn(0).getInt64();
    StreamAudit audit;
    audit.stream = {std::string(id), query.getColumn(1).getString(), ColumnUint32(query, 2)};
    audit.durable_seq = audit.highest_seq = ColumnUint32(query, 3);
    if (!query.getColumn(4).isNull()) audit.last_seq = ColumnUint32(query, 4);
    CountStoredRows(database, stream_id, &audit);
    CountDropped(database, stream_id, &audit);
    AddReported(database, stream_id, &audit);
    audits.push_back(std::move(audit));
  }
  return audits;
}

}  // namespace rigcal::server
