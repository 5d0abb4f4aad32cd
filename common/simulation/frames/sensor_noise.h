// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace rigcal {

// The sensor's output without noise and saturation, in 1/64 grey levels, black level
// included, up to kMaxLinear: beyond 255 so that what is saturated is free of noise.
inline constexpr int kLinearPerGrey = 64;
inline constexpr int16_t kMaxLinear = 430 * kLinearPerGrey;

int16_t ToLinear(double grey);

// Shot and read noise of a linear sensor: sigma^2 = read^2 + grey / electrons_per_grey. Gaussian
// numbers come from one large table, every row from another place of it, so that a frame costs
// little more than its own memory traffic. Thread-compatible.
class SensorNoise {
 public:
  SensorNoise(double read_noise_grey, double electrons_per_grey);

  // One sigma for each value, in 1/16 grey levels.
  void Sigma(std::span<const int16_t> linear, std::span<uint8_t> sigma) const;
  // Grey levels of row `row`: the light plus noise that follows from `seed` and the row.
  void Expose(std::span<const int16_t> linear, std::span<const uint8_t> sigma, uint64_t seed,
              int row, std::span<uint8_t> grey) const;

 private:
  std::vector<uint8_t> sigma_table_;  // by linear / 16
};

}  // namespace rigcal
