// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/camera_output.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace rigcal::camera_output_test {
namespace {

const ImageSize kSize{61, 43};  // no multiples of a block

// A bright disc on a slope, in one colour.
std::vector<uint8_t> Picture() {
  std::vector<uint8_t> bgr;
  for (int y = 0; y < 43; ++y) {
    for (int x = 0; x < 61; ++x) {
      const bool disc = std::hypot(x - 30, y - 20) < 9;
      bgr.push_back(static_cast<uint8_t>(disc ? 40 : 10 + x / 4));
      bgr.push_back(static_cast<uint8_t>(disc ? 120 : 12 + x / 4));
      bgr.push_back(static_cast<uint8_t>(disc ? 220 : 14 + x / 4));
    }
  }
  return bgr;
}

int LargestChange(const std::vector<uint8_t>& a, const std::vector<uint8_t>& b) {
  int largest = 0;
  for (size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

TEST(CameraOutput, BayerKeepsEvenAreasAndColoursEdges) {
  const std::vector<uint8_t> before = Picture();
  std::vector<uint8_t> after = before;
  ApplyBayer(kSize, after);
  EXPECT_GT(LargestChange(before, after), 20);
  const size_t middle = 3 * (20 * 61 + 30);
  for (size_t channel = 0; channel < 3; ++channel) {
    EXPECT_EQ(after[middle + channel], before[middle + channel]);
  }
}

TEST(CameraOutput, JpegLosesMoreWithLessQuality) {
  const std::vector<uint8_t> before = Picture();
  std::vector<uint8_t> best = before, poor = before;
  ApplyJpegLoss(kSize, 100, best);
  ApplyJpegLoss(kSize, 30, poor);
  double best_square = 0, poor_square = 0;
  for (size_t i = 0; i < before.size(); ++i) {
    best_square += std::pow(best[i] - before[i], 2);
    poor_square += std::pow(poor[i] - before[i], 2);
  }
  EXPECT_GT(poor_square, 1.5 * best_square);
  EXPECT_LT(poor_square / static_cast<double>(before.size()), 400);
}

}  // namespace
}  // namespace rigcal::camera_output_test
