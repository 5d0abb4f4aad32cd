// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <vector>

#include "server/solve/clocks/time_search.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::time_search_recorded_test {
namespace {

using ::rigcal::testing::IsOk;

// Phones and compact cameras with rolling shutters and rates of their own, started by hand, and one
// point far away. The starts were published to about 0.1 s.
TEST(SearchTimeOffsetsRecorded, FindsTheStartsOfConsumerCameras) {
  RIGCAL_REQUIRE_RECORDED_DATA(folder);
  const auto input = RecordedFlight(folder);
  ASSERT_THAT(input, IsOk());
  std::vector<ClockCorrection> clocks;
  const RigObservations rig = RigOf(*input, &clocks);
  ASSERT_EQ(clocks.size(), 4u);
  TimeSearchOutcome outcome;
  ASSERT_THAT(SearchTimeOffsets(rig, 0, {}, &clocks, &outcome), IsOk());
  EXPECT_TRUE(outcome.ambiguous.empty());
  EXPECT_EQ(clocks[0].time_offset_s, 0);
  EXPECT_NEAR(clocks[1].time_offset_s, 0.51, 0.1);
  EXPECT_NEAR(clocks[2].time_offset_s, 19.22, 0.1);
  EXPECT_NEAR(clocks[3].time_offset_s, 2.67, 0.1);
}

}  // namespace
}  // namespace rigcal::server::time_search_recorded_test
