// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace rigcal::testing {

// Takes what a fuzz target needs from the front of its input; zeros where that has ended. Plain
// bytes, so that a corpus can be written by hand.
class FuzzInput {
 public:
  FuzzInput(const uint8_t* data, size_t size) : rest_(data, size) {}

  uint8_t Byte() {
    if (rest_.empty()) return 0;
    const uint8_t value = rest_.front();
    rest_ = rest_.subspan(1);
    return value;
  }
  uint32_t Word16() {
    const uint32_t low = Byte();
    return low | static_cast<uint32_t>(Byte()) << 8;
  }
  // In [low, high]; `low` after the end of the input.
  uint32_t Between(uint32_t low, uint32_t high) { return low + Word16() % (high - low + 1); }

  bool empty() const { return rest_.empty(); }
  std::span<const uint8_t> rest() const { return rest_; }

 private:
  std::span<const uint8_t> rest_;
};

}  // namespace rigcal::testing
