// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/spot_likeness.h"

#include <gtest/gtest.h>

#include <vector>

namespace rigcal::agent::spot_likeness_test {
namespace {

Spot SpotOf(const Eigen::Vector3f& core) { return {.blob = Blob(), .core = core, .is_cut = false}; }

double UnlikenessOf(const std::vector<Spot>& spots) {
  WandCandidate candidate;
  candidate.blobs = {2, 0, 1};
  return Unlikeness(spots, candidate);
}

TEST(Unlikeness, IsThatOfBrightnessAndOfColour) {
  const Eigen::Vector3f orange(40, 110, 200), green(40, 200, 110);
  EXPECT_NEAR(UnlikenessOf({SpotOf(orange), SpotOf(orange), SpotOf(orange)}), 0, 1e-6);
  // Two at -ln(2) / 3 and one at twice as much, over 0.3.
  EXPECT_NEAR(UnlikenessOf({SpotOf(orange), SpotOf(2 * orange), SpotOf(orange)}), 3.56, 0.01);
  EXPECT_GT(UnlikenessOf({SpotOf(orange), SpotOf(green), SpotOf(orange)}), 8);
}

}  // namespace
}  // namespace rigcal::agent::spot_likeness_test
