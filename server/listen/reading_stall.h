// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "server/listen/flood_guard.h"

namespace rigcal::server {

// Finds that connections wait to be read because the threads that read all of them are held by a
// few. A server that has too much to do reads many, each a little late, which is no stall. Not for
// several threads.
class ReadingStall {
 public:
  // `readers` threads read connections.
  explicit ReadingStall(size_t readers) : readers_(readers) {}

  // Whether one has waited since the last call, and no more than the readers can hold were read in
  // between. To be called several times a second, with all open ones.
  bool Look(const std::vector<ConnectionTraffic>& open);

 private:
  struct Seen {
    uint64_t received_bytes = 0;
    uint64_t waiting_bytes = 0;
  };

  const size_t readers_;
  std::map<uint64_t, Seen> last_;  // by the connection's id
};

}  // namespace rigcal::server
