// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace rigcal {

// What became of a camera's pictures. received + damaged + lost is what the camera sent, as far as
// it can be told.
struct FrameCounts {
  uint64_t received = 0;  // whole
  uint64_t damaged = 0;   // missing packets, truncated or corrupt files; not yielded
  uint64_t lost = 0;      // numbers that never came
  uint64_t reconnects = 0;

  friend bool operator==(const FrameCounts&, const FrameCounts&) = default;
  FrameCounts& operator+=(const FrameCounts& other) {
    received += other.received;
    damaged += other.damaged;
    lost += other.lost;
    reconnects += other.reconnects;
    return *this;
  }
};

}  // namespace rigcal
