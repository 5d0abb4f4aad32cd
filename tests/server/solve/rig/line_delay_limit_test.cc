// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/line_delay_limit.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::line_delay_limit_test {
namespace {

TEST(LongestLineDelays, LeaveTheImageThePeriodOfAFrame) {
  RigObservations rig;
  rig.index.cameras.resize(2);
  rig.index.cameras[0].image_size_px = rig.index.cameras[1].image_size_px = {1280, 1000};
  rig.tracks.resize(2);
  rig.tracks[0].period_s = 0.04;
  rig.tracks[1].period_s = 0.08;  // every other frame has no row
  rig.tracks[1].frame_period_s = 0.04;
  rig.index.camera_of_track = {0, 0};
  const auto longest_s = LongestLineDelays(rig);
  EXPECT_NEAR(longest_s[0], 4e-5, 1e-12);
  EXPECT_EQ(longest_s[1], std::numeric_limits<double>::infinity());
}

TEST(HoldLongLineDelays, HoldsThoseThatAreFreeAndTooLong) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {});
  for (BundleCamera& camera : problem.cameras) camera.line_delay_s = -3e-5;
  problem.cameras[0].line_delay_fixed = problem.cameras[1].line_delay_fixed = false;
  EXPECT_EQ(HoldLongLineDelays({4e-5, 4e-5, 4e-5}, {-2e-5, 2e-5, -2e-5}, &problem), 1);
  EXPECT_TRUE(problem.cameras[0].line_delay_fixed);
  EXPECT_NEAR(problem.cameras[0].line_delay_s, -2e-5, 1e-12);  // -40 us together
  EXPECT_TRUE(IsAtLimit(-2e-5 + problem.cameras[0].line_delay_s, 4e-5));
  EXPECT_FALSE(problem.cameras[1].line_delay_fixed);
  EXPECT_EQ(problem.cameras[2].line_delay_s, -3e-5);  // not free
  EXPECT_FALSE(IsAtLimit(3.9e-5, 4e-5));
}

}  // namespace
}  // namespace rigcal::server::line_delay_limit_test
