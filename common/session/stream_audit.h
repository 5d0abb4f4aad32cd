// SPDX-License-Identifier: Apache-2.0
#pragma once

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

// Where the observations of one stream are: what the store has, counted row by row, and what the
// agent last reported.
struct StreamAudit {
  StreamKey stream;
  std::string agent_id;  // empty: none
  StreamHolder holder = StreamHolder::kNone;
  uint32_t durable_seq = 0;
  std::optional<uint32_t> last_seq;  // once the end of capture has come
  uint32_t highest_seq = 0;          // stored, or known to be dropped
  uint64_t stored_count = 0;         // refused and late rows included
  std::vector<Refusal> dropped;      // as stored; `camera` is empty
  std::optional<SpoolReport> reported;
};

}  // namespace rigcal
