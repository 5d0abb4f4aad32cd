// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/conflict_check.h"

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "server/store/batch_blob.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {
namespace {

// Compared as bytes: a NaN of a refused row equals itself.
template <typename Value>
bool SameValues(const std::vector<Value>& a, size_t a_row, const std::vector<Value>& b,
                size_t b_row, size_t width) {
  return std::memcmp(a.data() + a_row * width, b.data() + b_row * width, width * sizeof(Value)) ==
         0;
}

bool SameRow(const ObservationBatch& a, size_t a_row, const ObservationBatch& b, size_t b_row) {
  if (a.clock_epoch != b.clock_epoch || a.marker_count != b.marker_count) return false;
  const size_t markers = a.marker_count;
  const auto same = [&](const auto& of_a, const auto& of_b, size_t width) {
    return SameValues(of_a, a_row, of_b, b_row, width);
  };
  return same(a.time_ns, b.time_ns, 1) && same(a.visible_mask, b.visible_mask, 1) &&
         same(a.x_px, b.x_px, markers) && same(a.y_px, b.y_px, markers) &&
         same(a.cov_xx_px2, b.cov_xx_px2, markers) && same(a.cov_xy_px2, b.cov_xy_px2, markers) &&
         same(a.cov_yy_px2, b.cov_yy_px2, markers) &&
         same(a.time_delta_ns, b.time_delta_ns, markers) &&
         same(a.label_confidence, b.label_confidence, markers) &&
         same(a.centre_kind, b.centre_kind, markers);
}

void AddConflicts(uint32_t first_seq, uint32_t count, RowConflicts* conflicts) {
  if (conflicts->count == 0) conflicts->first_seq = first_seq;
  conflicts->count += count;
}

}  // namespace

ConflictCheck::ConflictCheck(SqlDatabase& database)
    : find_(database,
            "SELECT id, row_count, body FROM batch WHERE id > (?1<<32) AND id <= (?1<<32) + ?2 "
            "ORDER BY id DESC LIMIT 1"),
      find_next_(database,
                 "SELECT id & 4294967295 FROM batch WHERE id > (?1<<32) + ?2 AND "
                 "id < (?1<<32) + ?3 ORDER BY id LIMIT 1"),
      find_dropped_(database,
                    "SELECT first_seq, seq_count FROM dropped WHERE stream_id=?1 AND first_seq>="
                    "coalesce((SELECT max(first_seq) FROM dropped WHERE stream_id=?1 AND "
                    "first_seq<=?2), ?2) AND first_seq<?3 ORDER BY first_seq") {}

RowConflicts ConflictCheck::Compare(int64_t stream_id, const ObservationBatch& batch,
                                    SeqRange range) {
  RowConflicts conflicts;
  for (uint32_t seq = range.first; seq < range.end;) {
    const Record* record = Find(stream_id, batch.stream, seq);
    if (record == nullptr) {
      const uint32_t next = NextRow(stream_id, seq, range.end);
      CompareWithDropped(stream_id, {seq, next}, &conflicts);
      seq = next;
      continue;
    }
    const uint32_t end = std::min(range.end, record->end_seq);
    if (record->rows) {
      for (uint32_t row = seq; row < end; ++row) {
        if (!SameRow(batch, row - batch.first_seq, *record->rows, row - record->first_seq)) {
          AddConflicts(row, 1, &conflicts);
        }
      }
    }
    seq = end;
  }
  return conflicts;
}

void ConflictCheck::CompareWithDropped(int64_t stream_id, SeqRange range, RowConflicts* conflicts) {
  const StatementScope scope(find_dropped_);
  BindAll(find_dropped_, stream_id, range.first, range.end);
  while (find_dropped_.Step()) {
    const uint32_t first = find_dropped_.Uint32(0);
    const uint64_t end = uint64_t{first} + find_dropped_.Uint32(1);
    const uint32_t begin = std::max(first, range.first);
    if (end <= begin) continue;
    AddConflicts(begin, static_cast<uint32_t>(std::min<uint64_t>(end, range.end)) - begin,
                 conflicts);
  }
}

const ConflictCheck::Record* ConflictCheck::Find(int64_t stream_id, const StreamKey& stream,
                                                 uint32_t seq) {
  if (!last_ || last_->id >> 32 != stream_id || seq < last_->first_seq || seq >= last_->end_seq) {
    last_.reset();
    const StatementScope scope(find_);
    BindAll(find_, stream_id, seq);
    if (!find_.Step()) return nullptr;
    Record record;
    record.id = find_.Int64(0);
    record.first_seq = static_cast<uint32_t>(record.id & 0xffffffff);
    record.end_seq = static_cast<uint32_t>(
        std::min<uint64_t>(uint64_t{record.first_seq} + find_.Uint32(1), uint64_t{kMaxSeq} + 1));
    if (seq >= record.end_seq) return nullptr;
    absl::StatusOr<StoredBatch> stored = DecodeBatch(find_.Bytes(2), stream, record.first_seq);
    if (stored.ok() && stored->batch.end_seq() == record.end_seq) {
      record.rows = std::move(stored->batch);
    }
    last_ = std::move(record);
  }
  return &*last_;
}

uint32_t ConflictCheck::NextRow(int64_t stream_id, uint32_t seq, uint32_t end) {
  const StatementScope scope(find_next_);
  BindAll(find_next_, stream_id, seq, end);
  return find_next_.Step() ? find_next_.Uint32(0) : end;
}

}  // namespace rigcal::server
