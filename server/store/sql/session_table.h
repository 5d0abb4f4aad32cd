// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/session.h"
#include "common/session/stream_audit.h"
#include "server/store/record_list.h"
#include "server/store/sql/sql_database.h"

// Sessions in the database. Each function runs inside a transaction of the caller's and may throw
// the database's errors. Errors as in Store.
namespace rigcal::server {

absl::StatusOr<Session> InsertSession(SqlDatabase& database, Session session);
absl::Status ReplaceSession(SqlDatabase& database, const Session& session);
absl::StatusOr<Session> FindSession(SqlDatabase& database, std::string_view id);
std::vector<Listed<SessionSummary>> ListSessions(SqlDatabase& database, const SessionFilter& filter,
                                                 const ListPage& page);
// Makes the summaries of all sessions whose records can be read.
void SummarizeSessions(SqlDatabase& database);
// Batches, clock samples and alignments of its streams.
void EraseStreamRows(SqlDatabase& database, std::string_view id);
// Its observations too.
absl::Status EraseSession(SqlDatabase& database, std::string_view id);
// The observations only.
absl::Status EraseObservations(SqlDatabase& database, std::string_view id, int64_t utc_ns);
absl::StatusOr<std::vector<SessionCameraCounts>> ReadSessionCounts(SqlDatabase& database,
                                                                   std::string_view id);
// Of one camera, by stream epoch.
std::vector<StreamStatus> ReadStreams(SqlDatabase& database, int64_t camera_id);

// A stream as it is when its rows begin to be read.
struct AuditedStream {
  StreamAudit audit;                        // without its rows
  std::vector<StreamAudit::Range> dropped;  // in any order
  uint32_t last_first_seq = 0;              // of its batches
};
// In the order of ReadObservations.
absl::StatusOr<std::vector<AuditedStream>> ListAuditedStreams(SqlDatabase& database,
                                                              std::string_view id);

// NOT_FOUND: "no session s-000001".
absl::StatusOr<int64_t> SessionNumber(SqlDatabase& database, std::string_view id);

}  // namespace rigcal::server
