// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "common/status/status_macros.h"
#include "server/store/report_counts.h"
#include "server/store/sqlite/session_table.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {
namespace {

// The first number of the last batch. Where a page on the way to it is damaged: no limit.
uint32_t LastFirstSeq(SQLite::Database& database, int64_t stream_id) {
  try {
    SQLite::Statement query =
        Query(database,
              "SELECT id & 0xffffffff FROM batch "
              "WHERE id BETWEEN ?1<<32 AND (?1<<32)+0xffffffff ORDER BY id DESC LIMIT 1",
              stream_id);
    return query.executeStep() ? ColumnUint32(query, 0) : 0;
  } catch (const SQLite::Exception& error) {
    if (!absl::IsDataLoss(StatusFromSqlite(error, ""))) throw;
    return std::numeric_limits<uint32_t>::max();
  }
}

void ReadDropped(SQLite::Database& database, int64_t stream_id, AuditedStream* stream) {
  SQLite::Statement query = Query(
      database, "SELECT reason, first_seq, seq_count FROM dropped WHERE stream_id=?", stream_id);
  RefusalCounter counter;
  while (query.executeStep()) {
    const StreamAudit::Range range{.first_seq = ColumnUint32(query, 1),
                                   .count = ColumnUint32(query, 2)};
    counter.Add("", RefusalReasonFromName(query.getColumn(0).getString()), range.count);
    stream->dropped.push_back(range);
  }
  stream->audit.dropped = counter.List();
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

absl::StatusOr<std::vector<AuditedStream>> ListAuditedStreams(SQLite::Database& database,
                                                              std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  SQLite::Statement query =
      Query(database,
            "SELECT s.id, c.camera, s.stream_epoch, s.durable_seq, s.last_seq FROM stream s "
            "JOIN session_camera c ON s.camera_id=c.id WHERE c.session_number=? "
            "ORDER BY c.camera, s.stream_epoch",
            number);
  std::vector<AuditedStream> streams;
  while (query.executeStep()) {
    const int64_t stream_id = query.getColumn(0).getInt64();
    AuditedStream& stream = streams.emplace_back();
    stream.audit.stream = {std::string(id), query.getColumn(1).getString(), ColumnUint32(query, 2)};
    stream.audit.durable_seq = ColumnUint32(query, 3);
    if (!query.getColumn(4).isNull()) stream.audit.last_seq = ColumnUint32(query, 4);
    stream.last_first_seq = LastFirstSeq(database, stream_id);
    ReadDropped(database, stream_id, &stream);
    AddReported(database, stream_id, &stream.audit);
  }
  return streams;
}

}  // namespace rigcal::server
