// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/session/observation_batch.h"
#include "common/session/stream_key.h"
#include "common/target/observation.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// The part of one stream that the spool holds.
struct SpooledStream {
  StreamKey stream;
  uint32_t first_seq = 1;           // the oldest observation that is kept
  uint32_t end_seq = 1;             // one past the newest
  std::optional<EndOfCapture> end;  // once the capture has ended
};

// Keeps observations from the camera until the server has them on its disk. Numbers the
// observations of each stream, and frees nothing that has not been acknowledged. It ends with the
// process, so each start of the agent begins a stream epoch.
//
// Bounded by bytes over all streams: a full spool makes Append wait, and so the source.
// Thread-safe; one thread appends to a stream.
class MemorySpool {
 public:
  // `limit_bytes`: of observations over all streams. One of three markers takes 99 bytes.
  explicit MemorySpool(size_t limit_bytes = size_t{256} << 20) : limit_bytes_(limit_bytes) {}

  // Begins a stream of observations with `marker_count` markers, numbered from `first_seq` (>= 1).
  // ALREADY_EXISTS: it is open.
  absl::Status Open(const StreamKey& stream, int marker_count, uint32_t first_seq);

  // Adds the stream's next observation and the clock samples read with it; returns its number.
  // Waits while the spool is full.
  // NOT_FOUND: no such stream, or it was discarded while waiting.  INVALID_ARGUMENT: marker count.
  // FAILED_PRECONDITION: the stream has ended.  CANCELLED: Shutdown was called.
  absl::StatusOr<uint32_t> Append(const StreamKey& stream, const Observation& observation,
                                  const std::vector<ClockSample>& clock_samples);

  // Ends a stream after its last appended observation. `report.stream` and its observation_count
  // are filled in here. NOT_FOUND: no such stream.
  absl::Status Finish(const StreamKey& stream, CameraReport report);

  // At most `max_rows` (>= 1) observations from number `from_seq` on, all of one clock epoch, with
  // the clock samples read with them. Fewer rows are given where that is cheaper. Numbers between
  // `from_seq` and the first row that are not there any more are in `dropped`; no rows and nothing
  // dropped: there is nothing from `from_seq` on. NOT_FOUND: no such stream.
  absl::StatusOr<ObservationBatch> Read(const StreamKey& stream, uint32_t from_seq,
                                        size_t max_rows) const;

  // Everything up to `durable_seq` is safe at the server and may be freed. Numbers that were never
  // appended are not acknowledged by it.
  void Acknowledge(const StreamKey& stream, uint32_t durable_seq);

  // Drops a stream; returns how many observations that were not acknowledged are lost with it.
  uint32_t Discard(const StreamKey& stream);

  std::optional<SpooledStream> Find(const StreamKey& stream) const;
  // All of them, in the order of their keys.
  std::vector<SpooledStream> Streams() const;
  size_t bytes() const;

  // Ends every waiting and later Append; what is held can still be read and acknowledged.
  void Shutdown();

 private:
  struct NumberedSample {
    uint32_t seq = 0;  // of the observation it was read with
    ClockSample sample;
  };
  // Observations are kept in chunks of columns, each of one clock epoch, without gaps.
  struct Stream : SpooledStream {
    int marker_count = 0;
    uint32_t begin_seq = 1;    // the first number
    uint32_t durable_seq = 0;  // highest acknowledged
    std::deque<ObservationBatch> chunks;
    std::deque<NumberedSample> clock_samples;
  };

  const size_t limit_bytes_;
  mutable std::mutex mutex_;
  std::condition_variable space_changed_;
  std::map<StreamKey, Stream> streams_;
  size_t bytes_ = 0;
  bool shut_down_ = false;
};

}  // namespace rigcal::agent
