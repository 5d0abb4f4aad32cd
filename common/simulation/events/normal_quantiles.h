// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

namespace rigcal {

// Normal numbers for the price of a look in a table: 4096 equally likely values of mean 0 and
// sigma 1, up to 3.7 sigma away. 12 random bits choose one.
class NormalQuantiles {
 public:
  NormalQuantiles() {
    double sigma = 0;
    for (size_t i = 0; i < kCount / 2; ++i) {
      const double share = (static_cast<double>(i) + 0.5) / kCount;
      // Newton on the distribution above its middle, from the value before.
      for (int step = 0; step < 8; ++step) {
        const double beyond = 0.5 * std::erf(sigma / std::numbers::sqrt2) - share;
        const double density = std::exp(-0.5 * sigma * sigma) / std::sqrt(2 * std::numbers::pi);
        sigma -= beyond / density;
      }
      values_[kCount / 2 + i] = static_cast<float>(sigma);
      values_[kCount / 2 - 1 - i] = static_cast<float>(-sigma);
    }
  }

  // By the lowest 12 of `bits`.
  float At(uint64_t bits) const { return values_[bits % kCount]; }

 private:
  static constexpr size_t kCount = 4096;
  std::array<float, kCount> values_;
};

}  // namespace rigcal
