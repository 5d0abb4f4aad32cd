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
    : find_camera_(database,
                   "SELECT c.id, s.state FROM session s "
                   "JOIN session_camera c ON c.session_number=s.number "
                   "WHERE s.id=? AND c.camera=?"),
      find_stream_(database,
                   "SELECT id, durable_seq, last_seq, report_observation_count, "
                   "report_refused_count FROM stream WHERE camera_id=? AND stream_epoch=?"),
      find_report_counts_(database,
                          "SELECT coalesce(sum(count), 0) FROM report_count WHERE stream_id=?"),
      find_ranges_(database,
                   "SELECT id & 0xffffffff, row_count FROM batch "
                   "WHERE id > (?1<<32) + ?2 AND id <= (?1<<32) + 0xffffffff "
                   "UNION ALL SELECT first_seq, seq_count FROM dropped "
                   "WHERE stream_id=?1 AND first_seq>?2") {}

StreamState* StreamCache::Find(const StreamKey& stream) {
  if (const auto it = streams_.find(stream); it != streams_.end()) return it->second.get();
  auto state = std::make_unique<StreamState>();
  if (!LoadCamera(stream, state.get())) return nullptr;
  LoadStream(stream, state.get());
  return streams_.emplace(stream, std::move(state)).first->second.get();
}

void StreamCache::Trim() {
  if (streams_.size() > kMaxCachedStreams) Forget();
}

bool StreamCache::LoadCamera(const StreamKey& stream, StreamState* state) {
  const StatementScope scope(find_camera_);
  BindText(find_camera_, 1, stream.session_id);
  BindText(find_camera_, 2, stream.camera);
  if (!find_camera_.executeStep()) return false;
  state->camera_id = find_camera_.getColumn(0).getInt64();
  state->session_finished =
      find_camera_.getColumn(1).getInt() == static_cast<int>(SessionState::kFinished);
  return true;
}

void StreamCache::LoadStream(const StreamKey& stream, StreamState* state) {
  const StatementScope scope(find_stream_);
  find_stream_.bind(1, state->camera_id);
  find_stream_.bind(2, stream.stream_epoch);
  if (!find_stream_.executeStep()) return;
  state->stream_id = find_stream_.getColumn(0).getInt64();
  state->ledger = StreamLedger(ColumnUint32(find_stream_, 1));
  if (!find_stream_.getColumn(2).isNull()) state->last_seq = ColumnUint32(find_stream_, 2);
  state->report_observation_count = ColumnUint64(find_stream_, 3);
  state->report_refused_count = ColumnUint64(find_stream_, 4);
  LoadReportCounts(state);
  LoadEarlyRanges(state);
}

void StreamCache::LoadReportCounts(StreamState* state) {
  const StatementScope scope(find_report_counts_);
  find_report_counts_.bind(1, state->stream_id);
  find_report_counts_.executeStep();
  state->report_counted = ColumnUint64(find_report_counts_, 0);
}

void StreamCache::LoadEarlyRanges(StreamState* state) {
  const StatementScope scope(find_ranges_);
  find_ranges_.bind(1, state->stream_id);
  find_ranges_.bind(2, state->ledger.durable_seq());
  while (find_ranges_.executeStep()) {
    const uint32_t first = ColumnUint32(find_ranges_, 0);
    const uint64_t end = uint64_t{first} + ColumnUint32(find_ranges_, 1);
    state->ledger.Add({first, static_cast<uint32_t>(std::min<uint64_t>(end, kMaxSeq + 1))});
  }
}

}  // namespace rigcal::server
