// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "common/session/stream_key.h"
#include "server/store/delivery.h"
#include "server/store/sql/sql_database.h"
#include "server/store/stream_ledger.h"

namespace rigcal::server {

// Rows whose numbers are taken by rows with other values.
struct RowConflicts {
  uint32_t count = 0;
  uint32_t first_seq = 0;  // of the lowest of them
};

// Compares rows that arrive again with those that are stored. Reads the stored ones back, so it is
// for repeated rows only. May throw the database's errors.
class ConflictCheck {
 public:
  explicit ConflictCheck(SqlDatabase& database);

  // Of the rows of `batch` within `range`, all of which the stream has. Rows of a damaged record
  // are taken for equal: nobody can tell.
  RowConflicts Compare(int64_t stream_id, const ObservationBatch& batch, SeqRange range);
  // After a rollback, and whenever sessions have changed.
  void Forget() { last_.reset(); }

 private:
  // A stored batch, as it was last read: repeated rows come in the order of their numbers.
  struct Record {
    int64_t id = 0;
    uint32_t first_seq = 0;
    uint32_t end_seq = 0;
    std::optional<ObservationBatch> rows;  // none: damaged
  };
  // Numbers that were reported as lost have no values that a row could equal. Others without a row
  // lost theirs when the observations of the session were deleted; those are no conflict.
  void CompareWithDropped(int64_t stream_id, SeqRange range, RowConflicts* conflicts);
  // The record that has `seq`; null: there is none.
  const Record* Find(int64_t stream_id, const StreamKey& stream, uint32_t seq);
  // The first number after `seq` that has a row; `end` where there is none before it.
  uint32_t NextRow(int64_t stream_id, uint32_t seq, uint32_t end);

  SqlStatement find_;
  SqlStatement find_next_;
  SqlStatement find_dropped_;
  std::optional<Record> last_;
};

}  // namespace rigcal::server
