// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/device_clock.h"

#include <cstdlib>

namespace rigcal::agent {
namespace {

constexpr int64_t kImplausibleReadingNs = 2'000'000'000;
constexpr size_t kMostSamples = 1000;  // nobody takes them: keep the newest

}  // namespace

uint32_t DeviceClock::EpochOf(int64_t stamp_ns, const FrameArrival& arrival) {
  const int64_t device_minus_host_ns = arrival.device_ns - arrival.host_monotonic_ns;
  const bool went_back = last_stamp_ns_ && stamp_ns < *last_stamp_ns_;
  const bool stands_elsewhere =
      was_away_ && device_minus_host_ns_ &&
      std::abs(device_minus_host_ns - *device_minus_host_ns_) > kSameClockNs;
  if (went_back || stands_elsewhere) {
    ++epoch_;
    samples_.clear();
    best_arrival_.reset();
    last_reading_ns_.reset();
  }
  was_away_ = false;
  last_stamp_ns_ = stamp_ns;
  device_minus_host_ns_ = device_minus_host_ns;
  return epoch_;
}

bool DeviceClock::ReadingIsDue(int64_t host_monotonic_ns) const {
  return !last_reading_ns_ || host_monotonic_ns - *last_reading_ns_ >= kIntervalNs;
}

bool DeviceClock::AddReading(const ClockSample& sample) {
  const int64_t device_minus_host_ns = sample.device_ns - sample.host_monotonic_ns;
  if (device_minus_host_ns_ &&
      std::abs(device_minus_host_ns - *device_minus_host_ns_) > kImplausibleReadingNs) {
    return false;
  }
  last_reading_ns_ = sample.host_monotonic_ns;
  Keep(sample);
  return true;
}

void DeviceClock::AddArrival(FrameArrival arrival) {
  arrival.uncertainty_ns = kArrivalUncertaintyNs;
  const auto delay = [](const ClockSample& a) { return a.host_monotonic_ns - a.device_ns; };
  const bool second_is_over =
      best_arrival_ && arrival.host_monotonic_ns - second_began_ns_ >= kIntervalNs;
  if (second_is_over) {
    Keep(*best_arrival_);
  } else if (!best_arrival_ && samples_.empty() && !last_reading_ns_) {
    // The first reading is not to wait for a second to go by.
    last_reading_ns_ = arrival.host_monotonic_ns;
    Keep(arrival);
  }
  if (!best_arrival_ || second_is_over) {
    best_arrival_ = arrival;
    second_began_ns_ = arrival.host_monotonic_ns;
  } else if (delay(arrival) < delay(*best_arrival_)) {
    best_arrival_ = arrival;
  }
}

void DeviceClock::Keep(const ClockSample& sample) {
  if (samples_.size() >= kMostSamples) samples_.erase(samples_.begin());
  samples_.push_back(sample);
}

}  // namespace rigcal::agent
