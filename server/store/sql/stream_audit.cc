// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <exception>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "common/status/status_macros.h"
#include "server/store/report_counts.h"
#include "server/store/sql/session_table.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {
namespace {

// The first number of the last batch. Where a page on the way to it is damaged: no limit.
uint32_t LastFirstSeq(SqlDatabase& database, int64_t stream_id) {
  try {
    SqlStatement query =
        Query(database,
              "SELECT id & 4294967295 FROM batch "
              "WHERE id BETWEEN (?1<<32) AND (?1<<32)+4294967295 ORDER BY id DESC LIMIT 1",
              stream_id);
    return query.Step() ? query.Uint32(0) : 0;
  } catch (const std::exception& error) {
    if (!absl::IsDataLoss(database.StatusOf(error, ""))) throw;
    return std::numeric_limits<uint32_t>::max();
  }
}

void ReadDropped(SqlDatabase& database, int64_t stream_id, AuditedStream* stream) {
  SqlStatement query = Query(
      database, "SELECT reason, first_seq, seq_count FROM dropped WHERE stream_id=?", stream_id);
  RefusalCounter counter;
  while (query.Step()) {
    const StreamAudit::Range range{.first_seq = query.Uint32(1), .count = query.Uint32(2)};
    counter.Add("", RefusalReasonFromName(query.Text(0)), range.count);
    stream->dropped.push_back(range);
  }
  stream->audit.dropped = counter.List();
}

void AddReported(SqlDatabase& database, int64_t stream_id, StreamAudit* audit) {
  SqlStatement query = Query(
      database, "SELECT name, count FROM report_count WHERE stream_id=? ORDER BY name", stream_id);
  SpoolReport reported;
  while (query.Step()) {
    if (SetNamedCount(query.Text(0), query.Uint64(1), &reported)) {
      audit->reported = reported;
    }
  }
}

}  // namespace

absl::StatusOr<std::vector<AuditedStream>> ListAuditedStreams(SqlDatabase& database,
                                                              std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  SqlStatement query =
      Query(database,
            "SELECT s.id, c.camera, s.stream_epoch, s.durable_seq, s.last_seq FROM stream s "
            "JOIN session_camera c ON s.camera_id=c.id WHERE c.session_number=? "
            "ORDER BY c.camera, s.stream_epoch",
            number);
  std::vector<AuditedStream> streams;
  while (query.Step()) {
    const int64_t stream_id = query.Int64(0);
    AuditedStream& stream = streams.emplace_back();
    stream.audit.stream = {std::string(id), query.Text(1), query.Uint32(2)};
    stream.audit.durable_seq = query.Uint32(3);
    if (!query.IsNull(4)) stream.audit.last_seq = query.Uint32(4);
    stream.last_first_seq = LastFirstSeq(database, stream_id);
    ReadDropped(database, stream_id, &stream);
    AddReported(database, stream_id, &stream.audit);
  }
  return streams;
}

}  // namespace rigcal::server
