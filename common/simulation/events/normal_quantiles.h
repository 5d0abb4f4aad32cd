// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rigcal {

// Normal numbers for the price of a look in a table: 4096 equally likely values of mean 0 and
// sigma 1, up to 3.7 sigma away. 12 random bits choose one.
class NormalQuantiles {
 public:
  NormalQuantiles();

  // By the lowest 12 of `bits`.
  float At(uint64_t bits) const { return values_[bits % kCount]; }

 private:
  static constexpr size_t kCount = 4096;
  std::array<float, kCount> values_;
};

}  // namespace rigcal
