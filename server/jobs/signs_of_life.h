// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>

namespace rigcal::server {

struct SilenceLimits {
  // A worker that has given no sign of life for so long is said not to respond, and is ended.
  std::chrono::milliseconds doubt{30'000};
  std::chrono::milliseconds end{60'000};
  // It works, and its solve has gone no further.
  std::chrono::milliseconds stuck{std::chrono::minutes(15)};
};

// Whether a worker lives, by what it writes. Silence is time that its reader has spent waiting:
// where the reader was stopped too, or the whole machine, nothing has been missed.
class SignsOfLife {
 public:
  using Time = std::chrono::steady_clock::time_point;
  enum class State {
    kAlive,
    kDoubtful,  // not responding, so far
    kSilent,    // to be ended
    kStuck,     // likewise
  };

  SignsOfLife(SilenceLimits limits, Time now);

  // Something has come; `progress`: the solve has gone further.
  void Hear(bool progress);
  // To be called at least once a second.
  State Look(Time now);
  std::chrono::milliseconds silence() const { return silence_; }

 private:
  const SilenceLimits limits_;
  Time last_look_;
  std::chrono::milliseconds silence_{0}, standstill_{0};
};

}  // namespace rigcal::server
