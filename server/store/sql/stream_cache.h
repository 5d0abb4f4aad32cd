// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "absl/container/flat_hash_map.h"
#include "common/session/stream_key.h"
#include "server/store/sql/sql_database.h"
#include "server/store/stream_ledger.h"

namespace rigcal::server {

// The writer's copy of one stream's state; equal to the database after each commit.
struct StreamState {
  int64_t camera_id = 0;
  int64_t stream_id = 0;  // 0: the stream has no row yet
  bool session_finished = false;
  StreamLedger ledger;
  std::optional<uint32_t> last_seq;
  uint64_t report_observation_count = 0;
  uint64_t report_refused_count = 0;
  uint64_t report_counted = 0;            // sum of what the report counts beside refusals
  std::optional<uint64_t> spool_counted;  // the same of its spool report; none: not read yet
  bool changed = false;                   // must be written back before the commit
};

// Streams by key, read from the database when first asked for. May throw the database's errors.
class StreamCache {
 public:
  explicit StreamCache(SqlDatabase& database);

  // Null: no such session, or no such camera in it. The pointer is good until the next Forget or
  // Trim.
  StreamState* Find(const StreamKey& stream);
  // After a rollback, and whenever sessions have changed.
  void Forget() { streams_.clear(); }
  // Keeps the memory bounded; between transactions only.
  void Trim();

 private:
  void LoadEarlyRanges(StreamState* state);

  SqlStatement find_;
  SqlStatement find_ranges_;
  absl::flat_hash_map<StreamKey, std::unique_ptr<StreamState>> streams_;
};

}  // namespace rigcal::server
