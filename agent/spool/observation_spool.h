// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/observation_batch.h"
#include "common/session/spool_report.h"
#include "common/session/stream_key.h"
#include "common/target/observation.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// Rows that a spool lost, by reason. They have their numbers and will never be sent.
using DropCounts = std::map<RefusalReason, uint64_t>;

// The part of one stream that the spool holds.
struct SpooledStream {
  StreamKey stream;
  uint32_t first_seq = 1;    // the oldest observation that is kept
  uint32_t end_seq = 1;      // one past the newest
  uint32_t durable_seq = 0;  // the server has acknowledged all up to it
  uint32_t synced_seq = 0;   // all up to it survive what the spool survives
  uint64_t row_count = 0;    // kept, and not acknowledged
  DropCounts dropped;
  // Host times of its rows are of an earlier run of the operating system, whose monotonic clock
  // has no relation to today's.
  bool is_of_other_boot = false;
  std::optional<EndOfCapture> end;  // once the capture has ended
  // The capture was running when the agent ended, and nothing proves that `end` is where it was:
  // more may have been detected.
  bool end_is_unknown = false;
};

// What the server is told about it.
SpoolReport SpoolReportOf(const SpooledStream& stream);
std::vector<Refusal> ListOf(const DropCounts& dropped);

// Keeps observations from the camera until the server has them on its disk. Numbers the
// observations of each stream, and frees nothing that has not been acknowledged, unless it is told
// to drop the oldest when it is full. Numbers that were lost here are told to the server as dropped
// ranges, so that its positions advance.
//
// Thread-safe; one thread appends to a stream.
class ObservationSpool {
 public:
  ObservationSpool() = default;
  virtual ~ObservationSpool() = default;
  ObservationSpool(const ObservationSpool&) = delete;
  ObservationSpool& operator=(const ObservationSpool&) = delete;

  // Begins a stream of observations with `marker_count` markers, numbered from `first_seq` (>= 1).
  // ALREADY_EXISTS: it is open.  DATA_LOSS: as for Append.
  virtual absl::Status Open(const StreamKey& stream, int marker_count, uint32_t first_seq) = 0;

  // Adds the stream's next observation and the clock samples read with it; returns its number.
  // Waits while the spool is full, unless that drops the oldest.
  //   NOT_FOUND            no such stream, or it was discarded while waiting
  //   INVALID_ARGUMENT     marker count
  //   FAILED_PRECONDITION  the stream has ended
  //   CANCELLED            Shutdown was called
  //   DATA_LOSS            the spool's disk has failed; nothing is accepted any more
  virtual absl::StatusOr<uint32_t> Append(const StreamKey& stream, const Observation& observation,
                                          const std::vector<ClockSample>& clock_samples) = 0;

  // Ends a stream after its last appended observation. `report.stream` and its observation_count
  // are filled in here. NOT_FOUND: no such stream.
  virtual absl::Status Finish(const StreamKey& stream, CameraReport report) = 0;

  // At most `max_rows` (>= 1) observations from number `from_seq` on, all of one clock epoch, with
  // the clock samples read with them. Fewer rows are given where that is cheaper. Numbers between
  // `from_seq` and the first row that are not there any more are in `dropped`; no rows and nothing
  // dropped: there is nothing from `from_seq` on. NOT_FOUND: no such stream.
  virtual absl::StatusOr<ObservationBatch> Read(const StreamKey& stream, uint32_t from_seq,
                                                size_t max_rows) = 0;

  // Everything up to `durable_seq` is safe at the server and may be freed. Numbers that were never
  // appended are not acknowledged by it.
  virtual void Acknowledge(const StreamKey& stream, uint32_t durable_seq) = 0;

  // Drops a stream; returns how many observations that were not acknowledged are lost with it.
  virtual uint32_t Discard(const StreamKey& stream) = 0;

  virtual std::optional<SpooledStream> Find(const StreamKey& stream) const = 0;
  // All of them, in the order of their keys.
  virtual std::vector<SpooledStream> Streams() const = 0;
  virtual SpoolStatus Status() const = 0;
  // What it holds is delivered after a restart of the agent.
  virtual bool survives_restart() const = 0;

  // Ends every waiting and later Append; what is held can still be read and acknowledged.
  virtual void Shutdown() = 0;
};

}  // namespace rigcal::agent
