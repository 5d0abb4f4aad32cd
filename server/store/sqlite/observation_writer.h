// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>
#include <vector>

#include "absl/types/span.h"
#include "server/store/sqlite/count_changes.h"
#include "server/store/sqlite/stream_cache.h"
#include "server/store/store.h"

namespace rigcal::server {

// Adds deliveries to streams: Store::Append within a transaction of the caller's. Its functions may
// throw SQLite::Exception.
class ObservationWriter {
 public:
  explicit ObservationWriter(SQLite::Database& database);

  // Requests must have passed CheckAppendRequest.
  void Append(absl::Span<const AppendRequest> requests, std::vector<AppendOutcome>* outcomes);
  // After a rollback, and whenever sessions have changed.
  void Forget();

 private:
  void AppendOne(const AppendRequest& request, AppendOutcome* outcome);
  void AppendRows(const AppendRequest& request, StreamState* state, AppendOutcome* outcome);
  void InsertRows(const AppendRequest& request, SeqRange range, const StreamState& state,
                  AppendOutcome* outcome);
  void AppendDropped(const AppendRequest& request, StreamState* state);
  void AppendClockReadings(const AppendRequest& request, StreamState* state);
  void ReplaceReport(const StreamKey& stream, const CameraReport& report, StreamState* state);
  // Gives the stream its row in the database, and marks it as changed.
  void Touch(const StreamKey& stream, StreamState* state);
  void WriteBack();

  SQLite::Database& database_;
  StreamCache streams_;
  CountChanges counts_;
  std::vector<StreamState*> changed_;
  std::string blob_;  // kept for its capacity

  SQLite::Statement insert_stream_;
  SQLite::Statement update_stream_;
  SQLite::Statement insert_batch_;
  SQLite::Statement insert_dropped_;
  SQLite::Statement insert_clock_sample_;
  SQLite::Statement insert_host_alignment_;
  SQLite::Statement delete_report_;
  SQLite::Statement insert_report_;
  SQLite::Statement replace_report_count_;
};

// Columns that contradict each other, numbers outside of 1 to kMaxSeq, refused rows that are not of
// the batch: INVALID_ARGUMENT.
absl::Status CheckAppendRequest(const AppendRequest& request);

}  // namespace rigcal::server
