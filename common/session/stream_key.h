// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/camera/frame_counts.h"
#include "common/session/spool_report.h"
#include "common/status/refusal.h"
#include "common/target/detection_outcome.h"

namespace rigcal {

// A stream of one camera of a session: the observations from one start of an agent, with sequence
// numbers from 1. The epoch is random (agent/uplink/agent_state.h).
struct StreamKey {
  std::string session_id;
  std::string camera;
  uint32_t stream_epoch = 1;

  friend auto operator<=>(const StreamKey&, const StreamKey&) = default;

  template <typename H>
  friend H AbslHashValue(H state, const StreamKey& key) {
    return H::combine(std::move(state), key.session_id, key.camera, key.stream_epoch);
  }
};

// Totals of one stream since it began; each report replaces the one before.
struct CameraReport {
  StreamKey stream;
  uint64_t observation_count = 0;                  // rows the source yielded
  std::vector<Refusal> refused = {};               // by the source itself; `camera` may be empty
  std::optional<FrameCounts> frames = {};          // none: the source has no frames
  std::optional<DetectionCounts> detections = {};  // none: the source has no detector
  std::optional<SpoolReport> spool = {};           // none: an agent that does not say
};

// The end of a stream: nothing after `last_seq` will come.
struct EndOfCapture {
  StreamKey stream;
  uint32_t last_seq = 0;
  CameraReport report;
  // The agent ended before the capture did, and found the stream in its spool when it started
  // again. For the agent only.
  bool interrupted = false;
};

// A row that was refused by ingest, and why.
struct ObservationFault {
  uint32_t seq = 0;
  std::string field;  // "x_px[17]"
  RefusalReason reason = RefusalReason::kUnspecified;

  friend bool operator==(const ObservationFault&, const ObservationFault&) = default;
};

// Everything of the stream up to `durable_seq` survives kill -9 and power loss.
struct BatchAck {
  StreamKey stream;
  uint32_t durable_seq = 0;
  uint32_t send_limit_seq = 0;
  std::vector<ObservationFault> faults;  // at most 16 of them
  uint64_t fault_count = 0;
  bool complete = false;        // the end was received, and everything before it is durable
  uint64_t conflict_count = 0;  // rows with other values than the stored ones of their numbers
  // The same at the server's standby; 0 and false: it does not have it, or there is none.
  uint32_t standby_durable_seq = 0;
  bool standby_complete = false;
};

}  // namespace rigcal
