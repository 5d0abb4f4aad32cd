// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/time/clock.h"

namespace rigcal::agent {

// When a picture came, by the host's clocks.
struct FrameArrival {
  int64_t device_ns = 0;  // what the camera's clock showed about then: stamp + exposure
  int64_t host_monotonic_ns = 0;
  int64_t host_utc_ns = 0;
};

// Follows a camera's clock: tells when it began anew, and gathers readings of it beside the host's
// clocks, one a second. A reading is best taken from the camera (AddReading); from a camera that
// cannot be asked it is the picture that came with the least delay in that second, which is late by
// readout and network, so its uncertainty is kArrivalUncertaintyNs. For one thread.
class DeviceClock {
 public:
  static constexpr int64_t kIntervalNs = 1'000'000'000;
  static constexpr uint32_t kArrivalUncertaintyNs = 5'000'000;
  // After a reconnect: a clock this far from where it should be has begun anew.
  static constexpr int64_t kSameClockNs = 500'000'000;

  // The epoch of a picture's stamp: a new one when the clock went back, or when the camera was away
  // (Reconnected) and its clock no longer stands where it would. Stamps in capture order.
  uint32_t EpochOf(int64_t stamp_ns, const FrameArrival& arrival);
  void Reconnected() { was_away_ = true; }

  // Whether a second has gone since the last reading.
  bool ReadingIsDue(int64_t host_monotonic_ns) const;
  // A reading that the camera itself gave. False: it stands more than two seconds from where the
  // pictures' stamps put the clock, so it counts something else; it is not kept.
  bool AddReading(const ClockSample& sample);
  // To be called for every picture of a camera that cannot be asked.
  void AddArrival(const FrameArrival& arrival);

  // Gathered since the last call, all of the epoch of the last stamp.
  std::vector<ClockSample> Take();

 private:
  uint32_t epoch_ = 0;
  bool was_away_ = false;
  std::optional<int64_t> last_stamp_ns_;
  std::optional<int64_t> device_minus_host_ns_;  // by the last arrival
  std::optional<int64_t> last_reading_ns_;       // host monotonic
  std::optional<FrameArrival> best_arrival_;     // of this second
  int64_t second_began_ns_ = 0;
  std::vector<ClockSample> samples_;
};

}  // namespace rigcal::agent
