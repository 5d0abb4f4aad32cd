// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/stream_cache.h"

#include <algorithm>
#include <utility>

#include "common/session/observation_batch.h"
#include "common/session/session.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxCachedStreams = 4096;

}  // namespace

StreamCache::StreamCache(SqlDatabase& database)
    : find_(
          database,
          "SELECT c.id, s.state, t.id, t.durable_seq, t.last_seq, t.report_observation_count, "
          "t.report_refused_count, "
          "(SELECT CAST(coalesce(sum(count), 0) AS BIGINT) FROM report_count WHERE stream_id=t.id "
          "AND name NOT LIKE 'spool.%') "
          "FROM session s JOIN session_camera c ON s.number=c.session_number "
          "LEFT JOIN stream t ON t.camera_id=c.id AND t.stream_epoch=?3 "
          "WHERE s.id=?1 AND c.camera=?2"),
      find_ranges_(database,
                   "SELECT id & 4294967295, row_count FROM batch "
                   "WHERE id > (?1<<32) + ?2 AND id <= (?1<<32) + 4294967295 "
                   "UNION ALL SELECT first_seq, seq_count FROM dropped "
                   "WHERE stream_id=?1 AND first_seq>?2") {}

StreamState* StreamCache::Find(const StreamKey& stream) {
  if (const auto it = streams_.find(stream); it != streams_.end()) return it->second.get();
  const StatementScope scope(find_);
  BindAll(find_, stream.session_id, stream.camera, stream.stream_epoch);
  if (!find_.Step()) return nullptr;
  auto state = std::make_unique<StreamState>();
  state->camera_id = find_.Int64(0);
  state->session_finished = find_.Int64(1) == static_cast<int>(SessionState::kFinished);
  if (!find_.IsNull(2)) {
    state->stream_id = find_.Int64(2);
    state->ledger = StreamLedger(find_.Uint32(3));
    if (!find_.IsNull(4)) state->last_seq = find_.Uint32(4);
    state->report_observation_count = find_.Uint64(5);
    state->report_refused_count = find_.Uint64(6);
    state->report_counted = find_.Uint64(7);
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
  while (find_ranges_.Step()) {
    const uint32_t first = find_ranges_.Uint32(0);
    const uint64_t end = uint64_t{first} + find_ranges_.Uint32(1);
    state->ledger.Add({first, static_cast<uint32_t>(std::min<uint64_t>(end, kMaxSeq + 1))});
  }
}

}  // namespace rigcal::server
