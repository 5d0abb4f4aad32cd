// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/types/span.h"
#include "server/store/sql/conflict_check.h"
#include "server/store/sql/sql_database.h"
#include "server/store/sql/stream_cache.h"
#include "server/store/store.h"

namespace rigcal::server {

// Collects what one transaction adds to the counts of cameras, so that each row of counts is
// written once however many batches it holds. May throw the database's errors.
class CountChanges {
 public:
  explicit CountChanges(SqlDatabase& database);

  // Observations that were newly stored; refused ones not among them.
  void AddRows(int64_t camera_id, uint32_t clock_epoch, uint32_t observations, uint32_t wands,
               bool late);
  // `first_seq`: of the lowest one counted. The example that stays is of the lowest (stream_epoch,
  // seq) of all, so that it does not depend on the order of arrival.
  void AddRefusal(int64_t camera_id, RefusalReason reason, uint32_t count, uint32_t stream_epoch,
                  uint32_t first_seq, std::string_view detail);
  // Writes everything collected.
  void Flush();
  // Drops everything collected.
  void Clear() { cameras_.clear(); }

 private:
  struct RefusalChange {
    uint64_t count = 0;
    uint32_t stream_epoch = 0;
    uint32_t seq = 0;
    std::string detail;
  };
  struct CameraChange {
    uint64_t observations = 0;
    uint64_t wands = 0;
    uint64_t late = 0;
    std::map<uint32_t, uint64_t> clock_epochs;
    std::map<RefusalReason, RefusalChange> refusals;
  };
  void FlushCamera(int64_t camera_id, const CameraChange& change);

  SqlStatement add_to_camera_;
  SqlStatement add_to_clock_epoch_;
  SqlStatement add_refusal_;
  std::map<int64_t, CameraChange> cameras_;
};

// Adds deliveries to streams: Store::Append within a transaction of the caller's. Its functions may
// throw the database's errors.
class ObservationWriter {
 public:
  explicit ObservationWriter(SqlDatabase& database);

  void Append(absl::Span<const Delivery> deliveries, std::vector<AppendOutcome>* outcomes);
  // After a rollback, and whenever sessions have changed.
  void Forget();

 private:
  void AppendOne(const Delivery& delivery, AppendOutcome* outcome);
  void AppendRows(const Delivery& delivery, StreamState* state, AppendOutcome* outcome);
  void InsertRows(const Delivery& delivery, SeqRange range, const StreamState& state,
                  AppendOutcome* outcome);
  // Rows of numbers that the stream has.
  void NoteRepeatedRows(const Delivery& delivery, SeqRange range, const StreamState& state,
                        AppendOutcome* outcome);
  void AppendDropped(const Delivery& delivery, StreamState* state);
  void AppendClockReadings(const Delivery& delivery, StreamState* state);
  void ReplaceReport(const StreamKey& stream, const CameraReport& report, StreamState* state);
  void ReplaceSpoolReport(const StreamKey& stream, const SpoolReport& report, StreamState* state);
  // Gives the stream its row in the database, and marks it as changed.
  void Touch(const StreamKey& stream, StreamState* state);
  void WriteBack();

  StreamCache streams_;
  CountChanges counts_;
  ConflictCheck conflicts_;
  std::vector<StreamState*> changed_;
  std::string blob_;  // kept for its capacity

  SqlStatement insert_stream_;
  SqlStatement update_stream_;
  SqlStatement insert_batch_;
  SqlStatement insert_dropped_;
  SqlStatement insert_clock_sample_;
  SqlStatement insert_light_sample_;
  SqlStatement insert_host_alignment_;
  SqlStatement delete_report_;
  SqlStatement insert_report_;
  SqlStatement replace_report_count_;
  SqlStatement sum_spool_counts_;
};

}  // namespace rigcal::server
