// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/sensor_noise.h"

#include <algorithm>
#include <cmath>

#include "common/simulation/world/random_stream.h"

namespace rigcal {
namespace {

constexpr uint64_t kNoisePurpose = 0x6e6f697365;
constexpr size_t kFieldSize = size_t{1} << 20;
constexpr size_t kLongestRow = 3 * 65536;
constexpr size_t kBlock = 32;
constexpr int kTableStep = 16;

// Fixed trip count and no overlap, so that every compiler makes vector instructions of it.
void ExposeBlock(const int16_t* __restrict linear, const uint8_t* __restrict sigma,
                 const int8_t* __restrict noise, uint8_t* __restrict grey) {
  for (size_t i = 0; i < kBlock; ++i) {
    const auto product =
        static_cast<int16_t>(static_cast<int16_t>(noise[i]) * static_cast<int16_t>(sigma[i]));
    auto value = static_cast<int16_t>(linear[i] + (product >> 3));
    value = static_cast<int16_t>((value + kLinearPerGrey / 2) >> 6);
    value = std::clamp<int16_t>(value, 0, 255);
    grey[i] = static_cast<uint8_t>(value);
  }
}

// Gaussian numbers in 1/32 sigma; the end repeats the beginning, so that a row may begin anywhere.
const std::vector<int8_t>& NoiseField() {
  static const auto* const field = [] {
    auto* made = new std::vector<int8_t>(kFieldSize + kLongestRow);
    RandomStream random{kNoisePurpose};
    for (size_t i = 0; i < kFieldSize; ++i) {
      (*made)[i] =
          static_cast<int8_t>(std::clamp(std::lround(32 * random.Gaussian()), -127L, 127L));
    }
    std::copy_n(made->begin(), kLongestRow, made->begin() + kFieldSize);
    return made;
  }();
  return *field;
}

}  // namespace

int16_t ToLinear(double grey) {
  return static_cast<int16_t>(std::clamp(std::lround(grey * kLinearPerGrey), 0L, long{kMaxLinear}));
}

SensorNoise::SensorNoise(double read_noise_grey, double electrons_per_grey) {
  for (int linear = 0; linear <= kMaxLinear; linear += kTableStep) {
    const double grey = static_cast<double>(linear) / kLinearPerGrey;
    const double sigma = std::sqrt(read_noise_grey * read_noise_grey + grey / electrons_per_grey);
    sigma_table_.push_back(static_cast<uint8_t>(std::clamp(std::lround(16 * sigma), 0L, 255L)));
  }
}

void SensorNoise::Sigma(std::span<const int16_t> linear, std::span<uint8_t> sigma) const {
  for (size_t i = 0; i < linear.size(); ++i) {
    sigma[i] = sigma_table_[static_cast<size_t>(linear[i]) / kTableStep];
  }
}

void SensorNoise::Expose(std::span<const int16_t> linear, std::span<const uint8_t> sigma,
                         uint64_t seed, int row, std::span<uint8_t> grey) const {
  RandomStream random{seed, kNoisePurpose, static_cast<uint64_t>(row)};
  const int8_t* noise = NoiseField().data() + random.Bits() % kFieldSize;
  size_t i = 0;
  for (; i + kBlock <= grey.size(); i += kBlock) {
    ExposeBlock(&linear[i], &sigma[i], noise + i, &grey[i]);
  }
  for (; i < grey.size(); ++i) {
    const int value = (linear[i] + ((noise[i] * sigma[i]) >> 3) + kLinearPerGrey / 2) >> 6;
    grey[i] = static_cast<uint8_t>(std::clamp(value, 0, 255));
  }
}

}  // namespace rigcal
