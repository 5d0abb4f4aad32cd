// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "common/time/clock.h"

namespace rigcal::agent {

// The host's clocks.
inline int64_t MonotonicNowNs() {  // CLOCK_MONOTONIC
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}
inline int64_t UtcNowNs() {  // since 1970
  return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
}

// The arrival of a frame or of events by the host's clocks, with the device's clock at about that
// time: for a frame, timestamp + exposure.
using FrameArrival = ClockSample;

// Follows a camera's clock: detects restarts and pairs one reading a second with the host's clocks.
// The camera's own reading is best (AddReading). Without it, the frame that arrived with the least
// delay in that second serves; readout and network delay it, so its uncertainty is
// kArrivalUncertaintyNs. For one thread.
class DeviceClock {
 public:
  static constexpr int64_t kIntervalNs = 1'000'000'000;
  static constexpr uint32_t kArrivalUncertaintyNs = 5'000'000;
  // After a reconnect, a clock that deviates by more than this has restarted.
  static constexpr int64_t kSameClockNs = 500'000'000;

  // The clock epoch of a timestamp: a new one if the clock stepped back, or restarted while the
  // camera was away (Reconnected). Timestamps in capture order.
  uint32_t EpochOf(int64_t stamp_ns, const FrameArrival& arrival);
  void Reconnected() { was_away_ = true; }

  // True a second after the last reading.
  bool ReadingIsDue(int64_t host_monotonic_ns) const;
  // The camera's own reading. False: it is more than two seconds from the frames' timestamps, so it
  // is of another clock; it is discarded.
  bool AddReading(const ClockSample& sample);
  // For every frame of a camera whose clock cannot be read.
  void AddArrival(FrameArrival arrival);

  // Since the last call, all in the epoch of the last timestamp.
  std::vector<ClockSample> Take() { return std::exchange(samples_, {}); }

 private:
  void Keep(const ClockSample& sample);

  uint32_t epoch_ = 0;
  bool was_away_ = false;
  std::optional<int64_t> last_stamp_ns_;
  std::optional<int64_t> device_minus_host_ns_;  // by the last arrival
  std::optional<int64_t> last_reading_ns_;       // host monotonic
  std::optional<ClockSample> best_arrival_;      // of this second
  int64_t second_began_ns_ = 0;
  std::vector<ClockSample> samples_;
};

}  // namespace rigcal::agent
