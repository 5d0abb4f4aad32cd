// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/session/spool_report.h"
#include "common/session/stream_key.h"

namespace rigcal {

// Whether the agent of a stream has it in its spool.
enum class StreamHolder : uint8_t {
  kNone = 0,       // no agent delivers the camera
  kConnected = 1,  // it is connected and has the stream
  kAway = 2,       // it is not connected
  kGone = 3,       // it is connected and does not have the stream (any more)
};

// Where the observations of one stream are: what the store has, read row by row, and what the agent
// last reported. Up to highest_seq each number is stored, damaged, dropped or absent; a repeated
// one counts once.
struct StreamAudit {
  // Consecutive numbers.
  struct Range {
    uint32_t first_seq = 0;
    uint32_t count = 0;

    friend bool operator==(const Range&, const Range&) = default;
  };
  // Ranges that are listed of each kind; the counts are of all.
  static constexpr size_t kMaxRanges = 32;

  StreamKey stream;
  std::string agent_id;  // empty: none
  StreamHolder holder = StreamHolder::kNone;
  uint32_t durable_seq = 0;
  std::optional<uint32_t> last_seq;  // once the end of capture has come
  uint32_t highest_seq = 0;          // stored, damaged, or known to be dropped
  uint64_t stored_count = 0;         // readable; refused and late rows included
  uint64_t late_count = 0;           // of these, such that came after the session had finished
  uint64_t damaged_count = 0;        // stored, and cannot be read any more
  std::vector<Range> damaged = {};
  std::string damage = {};    // what is wrong with the first of them
  uint64_t absent_count = 0;  // up to highest_seq: nothing is known of them here
  std::vector<Range> absent = {};
  std::vector<Refusal> dropped;  // as stored; `camera` is empty
  std::optional<SpoolReport> reported;
};

}  // namespace rigcal
