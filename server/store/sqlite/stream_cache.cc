// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/stream_cache.h"

#include <algorithm>
#include <utility>

#include "common/session/observation_batch.h"
#include "common/session/session.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxCachedStreams = 4096;

}  // namespace

StreamCache::StreamCache(SQLite::Database& database)
    : find_(database,
            "SELECT c.id, s.state, t.id, t.durable_seq, t.last_seq, t.report_observation_count, "
            "t.report_refused_count, "
            "(SELECT coalesce(sum(count), 0) FROM report_count WHERE stream_id=t.id "
            "AND name NOT LIKE 'spool.%') "
            "FROM session s JOIN session_camera c ON s.number=c.session_number "
            "LEFT JOIN stream t ON t.camera_id=c.id AND t.stream_epoch=?3 "
            "WHERE s.id=?1 AND c.camera=?2"),
      find_ranges_(database,
                   "SELECT id & 0xffffffff, row_count FROM batch "
                   "WHERE id > (?1<<32) + ?2 AND id <= (?1<<32) + 0xffffffff "
                   "UNION ALL SELECT first_seq, seq_count FROM dropped "
                   "WHERE stream_id=?1 AND first_seq>?2") {}

StreamState* StreamCache::Find(const StreamKey& stream) {
  if (const auto it = streams_.find(stream); it != streams_.end()) return it->second.get();
  const StatementScope scope(find_);
  BindAll(find_, stream.session_id, stream.camera, stream.stream_epoch);
  if (!find_.executeStep()) return nullptr;
  auto state = std::make_unique<StreamState>();
  state->camera_id = find_.getColumn(0).getInt64();
  state->session_finished =
      find_.getColumn(1).getInt() == static_cast<int>(SessionState::kFinished);
  if (!find_.getColumn(2).isNull()) {
    state->stream_id = find_.getColumn(2).getInt64();
    state->ledger = StreamLedger(ColumnUint32(find_, 3));
    if (!find_.getColumn(4).isNull()) state->last_seq = ColumnUint32(find_, 4);
    state->report_observation_count = ColumnUint64(find_, 5);
    state->report_refused_count = ColumnUint64(find_, 6);
    state->report_counted = ColumnUint64(find_, 7);
    LoadEarlyRanges(state.get());
  }
  return streams_.emplace(stream, std::move(state)).first->second.get();
}

void StreamCache::Trim() {
  if (streams_.size() > kMaxCachedStreams) Forget();
}

void StreamCache::LoadEarlyRanges(StreamState* state) {
  const StatementScope scope(find_ranges_);
  BindAll(find_ranges_, state->stream_id, state->ledger.durable_seq());
  while (find_ranges_.executeStep()) {
    const uint32_t first = ColumnUint32(find_ranges_, 0);
    const uint64_t end = uint64_t{first} + ColumnUint32(find_ranges_, 1);
    state->ledger.Add({first, static_cast<uint32_t>(std::min<uint64_t>(end, kMaxSeq + 1))});
  }
}

}  // namespace rigcal::server
