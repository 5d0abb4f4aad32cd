// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

namespace rigcal::agent {

// Counts lost frames from gaps in the frame ids. GigE Vision has 16-bit ids that wrap from 65535 to
// 1 (0 is invalid); GigE Vision 2 and USB3 Vision have 64-bit ids, detected by an id above 65535.
class FrameIdTracker {
 public:
  // Frames lost immediately before `id`. 0 for the first frame, and for an id that does not follow
  // the last one: repeated, late, or 0 or 1 after a restart.
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

  // A frame without an id: counted as the next one.
  void ArrivedWithoutId() {
    if (last_) last_ = !wide_ && *last_ == kLargest16Bit ? 1 : *last_ + 1;
  }

  // A new stream: losses in between are not known.
  void Restart() { *this = {}; }

 private:
  static constexpr uint64_t kLargest16Bit = 65'535;
  static constexpr uint64_t kLongestGap = 10'000'000;  // more is a restarted count

  std::optional<uint64_t> last_;
  bool wide_ = false;
};

}  // namespace rigcal::agent
