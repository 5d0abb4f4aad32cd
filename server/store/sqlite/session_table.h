// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/session.h"
#include "common/session/stream_audit.h"
#include "server/store/record_list.h"

// Sessions in the database. Each function runs inside a transaction of the caller's and may throw
// SQLite::Exception. Errors as in Store.
namespace rigcal::server {

absl::StatusOr<Session> InsertSession(SQLite::Database& database, Session session);
absl::Status ReplaceSession(SQLite::Database& database, const Session& session);
absl::StatusOr<Session> FindSession(SQLite::Database& database, std::string_view id);
std::vector<Listed<SessionSummary>> ListSessions(SQLite::Database& database,
                                                 const SessionFilter& filter, const ListPage& page);
// Makes the summaries of all sessions whose records can be read.
void SummarizeSessions(SQLite::Database& database);
// Its observations too.
absl::Status EraseSession(SQLite::Database& database, std::string_view id);
// The observations only.
absl::Status EraseObservations(SQLite::Database& database, std::string_view id, int64_t utc_ns);
absl::StatusOr<std::vector<SessionCameraCounts>> ReadSessionCounts(SQLite::Database& database,
                                                                   std::string_view id);
// Of one camera, by stream epoch.
std::vector<StreamStatus> ReadStreams(SQLite::Database& database, int64_t camera_id);

// A stream as it is when its rows begin to be read.
struct AuditedStream {
  StreamAudit audit;                        // without its rows
  std::vector<StreamAudit::Range> dropped;  // in any order
  uint32_t last_first_seq = 0;              // of its batches
};
// In the order of ReadObservations.
absl::StatusOr<std::vector<AuditedStream>> ListAuditedStreams(SQLite::Database& database,
                                                              std::string_view id);

// NOT_FOUND: "no session s-000001".
absl::StatusOr<int64_t> SessionNumber(SQLite::Database& database, std::string_view id);

}  // namespace rigcal::server
