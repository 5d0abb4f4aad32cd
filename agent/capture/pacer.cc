// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/pacer.h"

#include <algorithm>

namespace rigcal::agent {

Pacer::Clock::time_point Pacer::DueTime(int64_t time_ns, Clock::time_point now) {
  if (!last_ns_) {
    last_due_ = now;
  } else if (time_ns > *last_ns_ && speed_ != kMaxSpeed) {
    // As doubles: two stamps may be further apart than 64 bits hold.
    const double gap_ns = (static_cast<double>(time_ns) - static_cast<double>(*last_ns_)) / speed_;
    constexpr double kMaxGapNs = std::chrono::duration<double, std::nano>(kMaxGap).count();
    last_due_ += std::chrono::nanoseconds(static_cast<int64_t>(std::min(gap_ns, kMaxGapNs)));
  }
  last_ns_ = time_ns;
  return last_due_;
}

void Pacer::Start() {
  const std::lock_guard lock(mutex_);
  last_ns_.reset();
  stopped_ = false;
}

void Pacer::Stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  stopped_changed_.notify_all();
}

bool Pacer::Wait(int64_t time_ns) {
  std::unique_lock lock(mutex_);
  if (!stopped_ && speed_ != kMaxSpeed) {
    stopped_changed_.wait_until(lock, DueTime(time_ns, Clock::now()), [this] { return stopped_; });
  }
  return !stopped_;
}

}  // namespace rigcal::agent
