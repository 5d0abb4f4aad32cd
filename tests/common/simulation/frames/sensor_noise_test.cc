// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/sensor_noise.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::sensor_noise_test {
namespace {

constexpr size_t kRowSize = 3 * 1280;

struct Moments {
  double mean = 0;
  double sigma = 0;
};

std::vector<uint8_t> Row(const SensorNoise& noise, double grey, uint64_t seed, int row,
                         size_t size = kRowSize) {
  const std::vector<int16_t> linear(size, ToLinear(grey));
  std::vector<uint8_t> sigma(size), out(size);
  noise.Sigma(linear, sigma);
  noise.Expose(linear, sigma, seed, row, out);
  return out;
}

Moments MomentsOf(const SensorNoise& noise, double grey) {
  double sum = 0, squares = 0, count = 0;
  for (int row = 0; row < 100; ++row) {
    for (const uint8_t value : Row(noise, grey, 5, row)) {
      sum += value;
      squares += static_cast<double>(value) * value;
      ++count;
    }
  }
  const double mean = sum / count;
  return {mean, std::sqrt(squares / count - mean * mean)};
}

TEST(SensorNoise, HasTheMeanOfTheLightAndTheSigmaOfReadAndShotNoise) {
  const SensorNoise noise(2.6, 40);
  for (const double grey : {30.0, 100.25, 180.5}) {
    const Moments moments = MomentsOf(noise, grey);
    EXPECT_NEAR(moments.mean, grey, 0.02);
    // Rounding to whole grey levels adds 1/12.
    EXPECT_NEAR(moments.sigma, std::sqrt(2.6 * 2.6 + grey / 40 + 1.0 / 12), 0.04);
  }
}

TEST(SensorNoise, SaturationIsFreeOfNoise) {
  for (const uint8_t value : Row(SensorNoise(2.6, 40), 400, 1, 0)) EXPECT_EQ(value, 255);
  for (const uint8_t value : Row(SensorNoise(2.6, 40), 1e9, 1, 0)) EXPECT_EQ(value, 255);
  for (const uint8_t value : Row(SensorNoise(0, 1e9), -5, 1, 0)) EXPECT_EQ(value, 0);
}

TEST(SensorNoise, FollowsFromSeedAndRow) {
  const SensorNoise noise(2.6, 40), again(2.6, 40);
  EXPECT_EQ(Row(noise, 50, 1, 3), Row(again, 50, 1, 3));
  EXPECT_NE(Row(noise, 50, 1, 3), Row(noise, 50, 2, 3));
  EXPECT_NE(Row(noise, 50, 1, 3), Row(noise, 50, 1, 4));
}

TEST(SensorNoise, RowsOfAnyLengthAreTheBeginningOfLongerOnes) {
  const SensorNoise noise(2.6, 40);
  const std::vector<uint8_t> whole = Row(noise, 50, 1, 3);
  for (const size_t size : {size_t{1}, size_t{31}, size_t{33}, size_t{100}}) {
    const std::vector<uint8_t> part = Row(noise, 50, 1, 3, size);
    EXPECT_TRUE(std::equal(part.begin(), part.end(), whole.begin())) << size;
  }
}

TEST(SensorNoise, StrongestNoiseNeitherOverflowsNorBiases) {
  const Moments moments = MomentsOf(SensorNoise(12, 40), 128);
  EXPECT_NEAR(moments.mean, 128, 0.1);
  EXPECT_NEAR(moments.sigma, std::sqrt(144 + 3.2), 0.2);
}

}  // namespace
}  // namespace rigcal::sensor_noise_test
