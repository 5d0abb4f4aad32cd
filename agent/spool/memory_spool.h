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

#include "agent/spool/observation_spool.h"

namespace rigcal::agent {

struct MemorySpoolOptions {
  // Bytes of observations over all streams at which Append waits. One observation of three markers
  // takes 99 bytes.
  size_t limit_bytes = size_t{256} << 20;

  absl::Status Validate() const;
};

// A spool in memory: it ends with the process, so each start of the agent begins a stream epoch.
class MemorySpool : public ObservationSpool {
 public:
  explicit MemorySpool(MemorySpoolOptions options = {}) : options_(options) {}

  absl::Status Open(const StreamKey& stream, int marker_count, uint32_t first_seq) override;
  absl::StatusOr<uint32_t> Append(const StreamKey& stream, const Observation& observation,
                                  const std::vector<ClockSample>& clock_samples) override;
  absl::Status Finish(const StreamKey& stream, CameraReport report) override;
  absl::StatusOr<ObservationBatch> Read(const StreamKey& stream, uint32_t from_seq,
                                        size_t max_rows) const override;
  void Acknowledge(const StreamKey& stream, uint32_t durable_seq) override;
  uint32_t Discard(const StreamKey& stream) override;
  std::optional<SpooledStream> Find(const StreamKey& stream) const override;
  std::vector<SpooledStream> Streams() const override;
  void Shutdown() override;

  size_t bytes() const;

 private:
  struct NumberedSample {
    uint32_t seq = 0;  // of the observation it was read with
    ClockSample sample;
  };
  // Observations are kept in chunks of columns, each of one clock epoch, without gaps.
  struct Stream {
    int marker_count = 0;
    uint32_t begin_seq = 1;    // the first number
    uint32_t first_seq = 1;    // oldest that is kept
    uint32_t durable_seq = 0;  // highest acknowledged
    uint32_t end_seq = 1;
    std::deque<ObservationBatch> chunks;
    std::deque<NumberedSample> clock_samples;
    std::optional<EndOfCapture> end;
  };

  static SpooledStream Describe(const StreamKey& key, const Stream& stream);
  ObservationBatch& ChunkFor(const StreamKey& key, Stream& stream, const Observation& observation);

  const MemorySpoolOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable space_changed_;
  std::map<StreamKey, Stream> streams_;
  size_t bytes_ = 0;
  bool shut_down_ = false;
};

}  // namespace rigcal::agent
