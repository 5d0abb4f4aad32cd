// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "server/listen/flood_guard.h"

namespace rigcal::server {

// Finds that connections wait to be read because the threads that read all of them are held by a
// few. A server that has too much to do reads many, each a little late, and one that gets no CPU
// time reads none for a moment, which is no stall. Not for several threads.
class ReadingStall {
 public:
  // `readers` threads read connections.
  explicit ReadingStall(size_t readers) : readers_(readers) {}

  using Clock = std::chrono::steady_clock;

  // A stall is one that has lasted so long.
  static constexpr std::chrono::milliseconds kLasting{200};

  // Whether, at each call of that time, one had waited since the call before it, and no more than
  // the readers can hold were read in between. To be called several times in it, with all open
  // ones.
  bool Look(const std::vector<ConnectionTraffic>& open, Clock::time_point now);

 private:
  struct Seen {
    uint64_t received_bytes = 0;
    uint64_t waiting_bytes = 0;
  };

  const size_t readers_;
  std::map<uint64_t, Seen> last_;  // by the connection's id
  Clock::time_point last_flow_ = {};
};

}  // namespace rigcal::server
