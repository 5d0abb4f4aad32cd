// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <random>

namespace rigcal::agent {

// The wait before the next attempt: exponential with full jitter, so that the agents of a rig do
// not reconnect all at once after their server was down. For one thread.
class Backoff {
 public:
  using Duration = std::chrono::steady_clock::duration;

  // The n-th wait is evenly distributed between 0 and min(highest, lowest * 2^n).
  Backoff(Duration lowest, Duration highest, uint64_t seed)
      : lowest_(lowest), highest_(highest), ceiling_(lowest), random_(seed) {}

  Duration Next() {
    const Duration ceiling = ceiling_;
    ceiling_ = ceiling_ > highest_ / 2 ? highest_ : 2 * ceiling_;
    return Duration(std::uniform_int_distribution<Duration::rep>(0, ceiling.count())(random_));
  }
  // After a good connection: starts again with the lowest wait.
  void Reset() { ceiling_ = lowest_; }

 private:
  Duration lowest_;
  Duration highest_;
  Duration ceiling_;
  std::mt19937_64 random_;
};

}  // namespace rigcal::agent
