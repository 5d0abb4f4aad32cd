// SPDX-License-Identifier: Apache-2.0
// What is wrong with a camera is said within ten seconds of waving; whoever presses second is told.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/live_rig.h"

namespace rigcal::testing::alerts_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

using AlertsOfPrograms = LiveRig;

TEST_F(AlertsOfPrograms, TellsOfACameraThatNeverSeesTheWand) {
  StartAgent(";dropouts=1");
  StartWave();
  EXPECT_LE(SecondsOfWavingUntil("no_wand sim_3"), kAlertLimitS);
}

TEST_F(AlertsOfPrograms, TellsOfAClockThatIsOff) {
  StartAgent(";offset.3=-3");
  StartWave();
  EXPECT_LE(SecondsOfWavingUntil("clock_off sim_3"), kAlertLimitS);
}

TEST_F(AlertsOfPrograms, TellsOfASecondWand) {
  StartAgent(";second_wand.3=0.4");
  StartWave();
  EXPECT_LE(SecondsOfWavingUntil("two_wands sim_3"), kAlertLimitS);
  EXPECT_THAT(Alerts(Get()), Not(Contains("two_wands sim_0")));
}

TEST_F(AlertsOfPrograms, WhoeverStartsOrStopsSecondIsTold) {
  StartAgent("");
  StartWave();
  const auto expect_told = [](const CommandResult& result, const std::string& since) {
    EXPECT_NE(result.exit_code, 0);
    EXPECT_THAT(result.error, HasSubstr(since));
  };
  // Another session with the same cameras, by somebody who did not see that one runs.
  expect_told(Rigcal({"session", "create", "--target", "wand:0,0.13,0.39", "--start"}),
              "takes part in session 'wave', which is capturing since 20");
  ASSERT_EQ(Rigcal({"session", "stop", "wave", "--wait"}).exit_code, 0);
  expect_told(Rigcal({"session", "start", "wave"}),
              "it has been stopped already and is finished since 20");
  const CommandResult again = Rigcal({"session", "stop", "wave"});
  EXPECT_EQ(again.exit_code, 0) << "it is as they wanted it";
  EXPECT_THAT(again.error, HasSubstr("session wave had been stopped already, at 20"));
}

}  // namespace
}  // namespace rigcal::testing::alerts_test
