// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/deploy/wand/simulated_board.h"

namespace rigcal::testing::trigger_firmware_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr BoardPin kOutputs[] = {BoardPin::kD9, BoardPin::kD10};
constexpr double kJitterS = 10e-6;

void ExpectPulses(SimulatedBoard* board, double hz, double width_s, double seconds) {
  board->Run(0.01);
  const double begin_s = board->time_s();
  board->Run(seconds);
  const PinTrace trace = board->TraceSince(kOutputs[0], begin_s);
  const PinSignal signal = MeasureSignal(trace);
  EXPECT_NEAR(signal.hz, hz, 1e-3 * hz);
  EXPECT_LT(signal.jitter_s, kJitterS);
  EXPECT_NEAR(signal.shortest_high_s, width_s, 4e-6);
  EXPECT_NEAR(signal.longest_high_s, width_s, 4e-6);
  EXPECT_EQ(board->TraceSince(kOutputs[1], begin_s), trace);  // both outputs are one
}

TEST(TriggerFirmware, Gives50HzWhenNew) {
  SimulatedBoard board("trigger");
  board.Run(0.2);
  EXPECT_THAT(board.TakeOutput(),
              AllOf(StartsWith("rigcal trigger"), HasSubstr("hz 50, width 4000 us, running")));
  ExpectPulses(&board, 50, 0.004, 1);
  EXPECT_TRUE(board.IsHigh(BoardPin::kD13));
}

TEST(TriggerFirmware, TakesRatesAndWidths) {
  SimulatedBoard board("trigger");
  board.Run(0.2);
  EXPECT_EQ(board.Send("width 2000"), "ok: hz 50, width 2000 us, running\r\n");
  EXPECT_EQ(board.Send("hz 120"), "ok: hz 120, width 2000 us, running\r\n");
  ExpectPulses(&board, 120, 0.002, 0.5);
  board.Send("width 20");
  board.Send("hz 200");
  ExpectPulses(&board, 200, 20e-6, 0.2);
  board.Send("width 4900");
  ExpectPulses(&board, 200, 0.0049, 0.2);
  board.Send("hz 5");
  board.Send("width 65535");
  ExpectPulses(&board, 5, 0.065535, 1.5);
}

TEST(TriggerFirmware, RefusesPulsesThatDoNotFit) {
  SimulatedBoard board("trigger");
  board.Run(0.2);
  board.Send("width 5000");
  const struct {
    const char* line;
    const char* answer;
  } cases[] = {
      {"hz 200",
       "error: a pulse of 5000 us does not fit into the period of 200 Hz; set the other "
       "one first\r\n"},
      {"width 19901",
       "error: a pulse of 19901 us does not fit into the period of 50 Hz; set the "
       "other one first\r\n"},
      {"hz 4", "error: hz can be 5 to 200, not 4\r\n"},
      {"hz 201", "error: hz can be 5 to 200, not 201\r\n"},
      {"hz 50 50", "error: hz takes 1 number(s), not 2; try help\r\n"},
      {"width 19", "error: width can be 20 to 65535, not 19\r\n"},
      {"width 1.5", "error: 1.5 is no whole number from 0 to 65535\r\n"},
      {"stop 1", "error: stop takes 0 number(s), not 1; try help\r\n"},
      {"fire", "error: no command fire; try help\r\n"},
  };
  for (const auto& entry : cases) EXPECT_EQ(board.Send(entry.line), entry.answer) << entry.line;
  ExpectPulses(&board, 50, 0.005, 0.3);
  EXPECT_THAT(board.Send("help"), HasSubstr("width 4000"));
}

TEST(TriggerFirmware, ButtonStopsAndStarts) {
  SimulatedBoard board("trigger");
  board.Run(0.2);
  board.Press(0.2);
  EXPECT_THAT(board.TakeOutput(), HasSubstr("stopped"));
  const double begin_s = board.time_s();
  board.Run(0.3);
  for (const BoardPin output : kOutputs) {
    EXPECT_FALSE(board.IsHigh(output));
    EXPECT_TRUE(board.TraceSince(output, begin_s).empty());
  }
  EXPECT_FALSE(board.IsHigh(BoardPin::kD13));
  board.Press(0.2);
  ExpectPulses(&board, 50, 0.004, 0.3);
  EXPECT_EQ(board.Send("stop"), "ok: hz 50, width 4000 us, stopped\r\n");
  EXPECT_EQ(board.Send("start"), "ok: hz 50, width 4000 us, running\r\n");
  ExpectPulses(&board, 50, 0.004, 0.3);
}

TEST(TriggerFirmware, KeepsSettingsButNotThoseOfAWand) {
  SimulatedBoard board("trigger");
  board.Run(0.2);
  board.Send("hz 25");
  SimulatedBoard later("trigger", board.Eeprom());
  later.Run(0.1);
  EXPECT_THAT(later.TakeOutput(), HasSubstr("hz 25, width 4000 us, running"));
  ExpectPulses(&later, 25, 0.004, 0.5);
  EXPECT_THAT(later.Send("reset"), StartsWith("ok: hz 50, width 4000 us"));

  SimulatedBoard wand("wand");
  wand.Run(0.1);
  wand.Send("hz 300");
  SimulatedBoard now_a_trigger("trigger", wand.Eeprom());
  now_a_trigger.Run(0.1);
  EXPECT_THAT(now_a_trigger.TakeOutput(), AllOf(HasSubstr("damaged"), HasSubstr("hz 50,")));
}

}  // namespace
}  // namespace rigcal::testing::trigger_firmware_test
