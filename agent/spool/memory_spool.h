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
#include "agent/spool/observation_spool.h"
#include "common/session/observation_batch.h"
#include "common/session/stream_key.h"
#include "common/target/observation.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// A spool in memory: it ends with the process, and what it holds is lost then. For `rigcal local`
// and tests. Bounded by bytes over all streams: a full spool makes Append wait, and so the source.
class MemorySpool final : public ObservationSpool {
 public:
  // `limit_bytes`: of observations over all streams. One of three markers takes 99 bytes.
  explicit MemorySpool(size_t limit_bytes = size_t{256} << 20) : limit_bytes_(limit_bytes) {}

  absl::Status Open(const StreamKey& stream, int marker_count, uint32_t first_seq) override;
  absl::StatusOr<uint32_t> Append(const StreamKey& stream, const Observation& observation,
                                  const std::vector<ClockSample>& clock_samples) override;
  absl::Status Finish(const StreamKey& stream, CameraReport report) override;
  absl::StatusOr<ObservationBatch> Read(const StreamKey& stream, uint32_t from_seq,
                                        size_t max_rows) override;
  void Acknowledge(const StreamKey& stream, uint32_t durable_seq) override;
  uint32_t Discard(const StreamKey& stream) override;
  std::optional<SpooledStream> Find(const StreamKey& stream) const override;
  std::vector<SpooledStream> Streams() const override;
  SpoolStatus Status() const override;
  bool survives_restart() const override { return false; }
  void Shutdown() override;

  size_t bytes() const;

 private:
  struct NumberedSample {
    uint32_t seq = 0;  // of the observation it was read with
    ClockSample sample;
  };
  // Observations are kept in chunks of columns, each of one clock epoch, without gaps.
  struct Stream : SpooledStream {
    int marker_count = 0;
    uint32_t begin_seq = 1;  // the first number
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
