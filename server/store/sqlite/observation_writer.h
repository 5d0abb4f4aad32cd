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

  void Append(absl::Span<const Delivery> deliveries, std::vector<AppendOutcome>* outcomes);
  // After a rollback, and whenever sessions have changed.
  void Forget();

 private:
  void AppendOne(const Delivery& delivery, AppendOutcome* outcome);
  void AppendRows(const Delivery& delivery, StreamState* state, AppendOutcome* outcome);
  void InsertRows(const Delivery& delivery, SeqRange range, const StreamState& state,
                  AppendOutcome* outcome);
  void AppendDropped(const Delivery& delivery, StreamState* state);
  void AppendClockReadings(const Delivery& delivery, StreamState* state);
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

}  // namespace rigcal::server
