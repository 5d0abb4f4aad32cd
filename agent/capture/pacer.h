// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <limits>
#include <mutex>
#include <optional>

namespace rigcal::agent {

// Yield everything at once.
inline constexpr double kMaxSpeed = std::numeric_limits<double>::infinity();

// Makes the thread of a source wait until a row is due, so that rows with camera times, in capture
// order, come at `speed` times their own pace. The first row and one that steps backwards are due
// at once; waiting is limited to kMaxGap, so that a damaged timestamp cannot stop a replay for
// years. Stop may be called by any thread.
class Pacer {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kMaxGap{10};

  explicit Pacer(double speed) : speed_(speed) {}

  void Start();  // a new capture: the next row is the first
  void Stop();   // every Wait returns false until the next Start
  // False: stopped.
  bool Wait(int64_t time_ns);

  // When the next row is due. `now` counts for the first row only. For the waiting thread.
  Clock::time_point DueTime(int64_t time_ns, Clock::time_point now);

 private:
  const double speed_;
  std::optional<int64_t> last_ns_;
  Clock::time_point last_due_;
  std::mutex mutex_;
  std::condition_variable stopped_changed_;
  bool stopped_ = true;
};

}  // namespace rigcal::agent
