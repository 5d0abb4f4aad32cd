// SPDX-License-Identifier: Apache-2.0
#include "common/lens/view_coverage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::view_coverage_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

BoardView ViewOf(const std::vector<Eigen::Vector2d>& pixels) {
  BoardView view;
  for (const Eigen::Vector2d& pixel : pixels) {
    view.corners.push_back({Eigen::Vector3d::Zero(), pixel});
  }
  return view;
}

TEST(ViewCoverage, NamesBareSides) {
  const ImageSize image{100, 100};
  EXPECT_THAT(BareSides({ViewOf({{50, 10}, {50, 90}, {95, 50}})}, image),
              ElementsAre("no corner in the left fifth of the image"));
  EXPECT_THAT(BareSides({ViewOf({{10, 10}}), ViewOf({{95, 95}})}, image), IsEmpty());
  EXPECT_EQ(BareSides({}, image).size(), 4u);
}

TEST(ViewCoverage, CountsCells) {
  const ImageSize image{100, 50};
  EXPECT_EQ(CoveredShare({}, image), 0);
  EXPECT_DOUBLE_EQ(CoveredShare({ViewOf({{1, 1}, {2, 2}, {99.4, 49.4}})}, image), 0.02);
}

}  // namespace
}  // namespace rigcal::view_coverage_test
