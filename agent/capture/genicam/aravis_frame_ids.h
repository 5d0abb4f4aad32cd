// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

namespace rigcal::agent {

// Finds the pictures that never came, from the numbers of those that did. GigE Vision counts in 16
// bits, from 65535 on to 1 (0 is no number there); GigE Vision 2 and USB3 Vision count in 64 bits.
// Which of the two is seen from the numbers: 64 bits once one is above 65535.
class FrameIdTracker {
 public:
  // How many were lost just before this one, whose number is `id`. 0 for the first one, and for a
  // number that is not ahead of the last one: repeated, late, or 0 or 1 of a count that began anew.
  uint64_t Arrived(uint64_t id) {
    if (id > kLargest16Bit) wide_ = true;
    const std::optional<uint64_t> last = last_;
    if (!last) {
      last_ = id;
      return 0;
    }
    const uint64_t steps = wide_ ? id - *last : (id + kLargest16Bit - *last) % kLargest16Bit;
    const bool ahead = steps != 0 && steps <= (wide_ ? kLongestGap : kLargest16Bit / 2);
    if (ahead || id <= 1) last_ = id;
    return ahead ? steps - 1 : 0;
  }

  // One whose number did not come with it: the next in turn.
  void ArrivedWithoutId() {
    if (last_) last_ = !wide_ && *last_ == kLargest16Bit ? 1 : *last_ + 1;
  }

  // A new stream: what is lost between is not known.
  void Restart() { *this = {}; }

 private:
  static constexpr uint64_t kLargest16Bit = 65'535;
  static constexpr uint64_t kLongestGap = 10'000'000;  // more is no gap but another count

  std::optional<uint64_t> last_;
  bool wide_ = false;
};

}  // namespace rigcal::agent
