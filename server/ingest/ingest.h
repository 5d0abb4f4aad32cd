// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/session.h"
#include "common/target/observation.h"
#include "server/store/store.h"

namespace rigcal::server {

// What arrives for one stream: rows, an end, a report, or several of them.
struct Delivery {
  StreamKey stream;
  ObservationBatch batch;  // rows() == 0 and nothing dropped: none
  std::optional<EndOfCapture> end;
  std::optional<CameraReport> report;

  size_t Bytes() const;  // memory it holds, for bounding queues
};

// What ingest must know of a stream's camera to check its values.
struct StreamContext {
  ImageSize image_size_px;
  int marker_count = 0;
};

// Where ingest asks for it. Thread-safe, never blocks on the disk.
class StreamContextSource {
 public:
  virtual ~StreamContextSource() = default;
  // NOT_FOUND: no such session, or no such camera in it. FAILED_PRECONDITION: not started.
  virtual absl::StatusOr<StreamContext> GetStreamContext(const StreamKey& stream) const = 0;
};

struct IngestOptions {
  // Bytes of waiting deliveries at which Submit says "full".
  size_t queue_limit_bytes = 64u << 20;
  // One transaction takes at most this many bytes of deliveries.
  size_t group_limit_bytes = 1u << 20;
  // Rows an agent may have unacknowledged per stream.
  uint32_t send_window = 32768;

  absl::Status Validate() const;
};

struct IngestStats {
  uint32_t stored_observation_count = 0;
  uint32_t duplicate_observation_count = 0;
  uint32_t refused_observation_count = 0;
  uint32_t commit_count = 0;
  size_t queue_bytes = 0;
  std::string problem;  // empty: healthy
};

using IngestCallback = std::function<void(absl::StatusOr<BatchAck>)>;

// Checks deliveries, and writes them through one writer: an acknowledgement means that the rows are
// on disk. Knows no gRPC.
class Ingest {
 public:
  virtual ~Ingest() = default;

  // Checks `delivery` and queues it. Thread-safe; never blocks.
  //   OK                  taken; `done` is called exactly once, later, on the writer's thread, and
  //                       must not block
  //   INVALID_ARGUMENT    fault in protocol (marker count); the message names the field
  //   NOT_FOUND, FAILED_PRECONDITION   from the StreamContextSource
  //   RESOURCE_EXHAUSTED  the queue is full; `delivery` is untouched, and `on_space` is called once
  //                       when there is room again, or at shutdown (on the writer's thread)
  //   UNAVAILABLE         shutting down
  //   INTERNAL            the store has failed, see IngestStats::problem; a restart is needed
  // `done` gets NOT_FOUND when the session was deleted meanwhile, RESOURCE_EXHAUSTED when the disk
  // is full (nothing of the delivery is stored; send it again later), else the store's error.
  // `delivery` is moved from only when OK.
  virtual absl::Status Submit(Delivery& delivery, IngestCallback done,
                              std::function<void()> on_space) = 0;
  virtual IngestStats Stats() const = 0;
};

}  // namespace rigcal::server
