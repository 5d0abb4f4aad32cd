// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/deploy/wand/simulated_board.h"

namespace rigcal::testing::wand_firmware_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr BoardPin kLeds[] = {BoardPin::kD9, BoardPin::kD10, BoardPin::kD3};
constexpr double kJitterS = 10e-6;
constexpr double kRelativeHz = 1e-3;
constexpr double kSettleS = 0.02;  // from a change of settings to even blinking

// Blinks by these frequencies from now on, each LED with this duty cycle in every single period.
void ExpectBlinking(SimulatedBoard* board, const std::vector<double>& hz, double duty,
                    double seconds = 0.25) {
  board->Run(kSettleS);
  const double begin_s = board->time_s();
  board->Run(seconds);
  for (size_t i = 0; i < std::size(kLeds); ++i) {
    SCOPED_TRACE(::testing::Message() << "LED " << i + 1 << " at " << hz[i] << " Hz");
    const PinSignal signal = MeasureSignal(board->TraceSince(kLeds[i], begin_s));
    EXPECT_NEAR(signal.hz, hz[i], kRelativeHz * hz[i]);
    EXPECT_LT(signal.jitter_s, kJitterS);
    EXPECT_NEAR(signal.duty, duty, 0.002);
    EXPECT_NEAR(signal.shortest_high_s, duty / hz[i], kJitterS);
    EXPECT_NEAR(signal.longest_high_s, duty / hz[i], kJitterS);
  }
}

TEST(WandFirmware, BlinksAt500HzWhenNew) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  EXPECT_THAT(board.TakeOutput(),
              AllOf(StartsWith("rigcal wand"), HasSubstr("these are new"),
                    HasSubstr("hz 500 500 500, duty 50 %, brightness 100 %, low 3500 mV")));
  ExpectBlinking(&board, {500, 500, 500}, 0.5, 1);
}

TEST(WandFirmware, LedsOfOneFrequencyRiseTogether) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  const double begin_s = board.time_s();
  board.Run(0.1);
  const double first_s = MeasureSignal(board.TraceSince(kLeds[0], begin_s)).first_rise_s;
  for (const BoardPin led : kLeds) {
    EXPECT_NEAR(MeasureSignal(board.TraceSince(led, begin_s)).first_rise_s, first_s, kJitterS);
  }
}

TEST(WandFirmware, TakesFrequenciesAndDutyCycles) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  EXPECT_THAT(board.Send("hz 400 500 620"), StartsWith("ok: hz 400 500 620, duty 50 %"));
  ExpectBlinking(&board, {400, 500, 620}, 0.5, 0.5);
  EXPECT_THAT(board.Send("duty 20"), HasSubstr("duty 20 %"));
  ExpectBlinking(&board, {400, 500, 620}, 0.2);
  EXPECT_THAT(board.Send("hz 200"), StartsWith("ok: hz 200 200 200"));
  ExpectBlinking(&board, {200, 200, 200}, 0.2);
}

// The ends of both ranges, where the steps of LED 3's 8-bit timer are shortest and most.
TEST(WandFirmware, BlinksAtEveryEndOfItsRanges) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  for (const int hz : {100, 617, 1000}) {
    board.Send("hz " + std::to_string(hz));
    for (const int duty_pct : {5, 50, 95}) {
      SCOPED_TRACE(duty_pct);
      board.Send("duty " + std::to_string(duty_pct));
      ExpectBlinking(&board, std::vector<double>(3, hz), 0.01 * duty_pct, 0.1);
    }
  }
}

TEST(WandFirmware, SerialTrafficMovesNoLight) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  const double begin_s = board.time_s();
  EXPECT_THAT(board.Send("help"), HasSubstr("hz 400 500 620"));
  EXPECT_THAT(board.Send("SHOW"), AllOf(HasSubstr("hz 500 500 500"), HasSubstr("battery 3994 mV")));
  for (const BoardPin led : kLeds) {
    EXPECT_LT(MeasureSignal(board.TraceSince(led, begin_s)).jitter_s, kJitterS);
  }
}

TEST(WandFirmware, DimsBySwitchingTheCommonPath) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  EXPECT_TRUE(board.IsHigh(BoardPin::kD6));
  double begin_s = board.time_s();
  board.Run(0.1);
  EXPECT_TRUE(board.TraceSince(BoardPin::kD6, begin_s).empty());
  for (const int percent :
       {10, 25, 50, 90}) {  // at 99 the dark part has three cycles, which simavr misses
    board.Send("brightness " + std::to_string(percent));
    begin_s = board.time_s();
    board.Run(0.01);
    const PinSignal signal = MeasureSignal(board.TraceSince(BoardPin::kD6, begin_s));
    EXPECT_NEAR(signal.hz, 62500, 60);
    EXPECT_NEAR(signal.duty, 0.01 * percent, 0.01);
  }
  board.Send("brightness 100");
  EXPECT_TRUE(board.IsHigh(BoardPin::kD6));
}

TEST(WandFirmware, RefusesWhatItCannotDo) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  const struct {
    const char* line;
    const char* answer;
  } cases[] = {
      {"hz 99", "error: hz can be 100 to 1000, not 99\r\n"},
      {"hz 400 500 1001", "error: hz can be 100 to 1000, not 1001\r\n"},
      {"hz", "error: hz takes one number, or three; try help\r\n"},
      {"hz 400 500", "error: hz takes one number, or three; try help\r\n"},
      {"hz 1 2 3 4", "error: too many numbers; try help\r\n"},
      {"hz 5e2", "error: 5e2 is no whole number from 0 to 65535\r\n"},
      {"hz -500", "error: -500 is no whole number from 0 to 65535\r\n"},
      {"hz 66036", "error: 66036 is no whole number from 0 to 65535\r\n"},  // 65536 + 500
      {"duty", "error: duty takes 1 number(s), not 0; try help\r\n"},
      {"duty 4", "error: duty can be 5 to 95, not 4\r\n"},
      {"duty 306", "error: duty can be 5 to 95, not 306\r\n"},  // 256 + 50
      {"brightness 0", "error: brightness can be 10 to 100, not 0\r\n"},
      {"low 100", "error: low can be 2500 to 9000, not 100\r\n"},
      {"reset 1", "error: reset takes 0 number(s), not 1; try help\r\n"},
      {"blink 500", "error: no command blink; try help\r\n"},
      {"hz 500                                          ",
       "error: the line is too long or holds what is no text; try help\r\n"},
      {"hz\t500", "error: the line is too long or holds what is no text; try help\r\n"},
  };
  for (const auto& entry : cases) EXPECT_EQ(board.Send(entry.line), entry.answer) << entry.line;
  EXPECT_EQ(board.Send(""), "");
  EXPECT_THAT(board.Send("show"), StartsWith("hz 500 500 500, duty 50 %, brightness 100 %"));
  // Backspace takes back what was mistyped.
  EXPECT_THAT(board.Send("hz 5\b400"), HasSubstr("ok: hz 400 400 400"));
}

TEST(WandFirmware, KeepsSettingsWithoutPower) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Send("hz 300 400 480");
  board.Send("duty 30");
  board.Send("brightness 40");
  board.Send("low 4400");
  SimulatedBoard later("wand", board.Eeprom());
  later.Run(0.3);
  const std::string output = later.TakeOutput();
  EXPECT_THAT(output, HasSubstr("hz 300 400 480, duty 30 %, brightness 40 %, low 4400 mV"));
  EXPECT_THAT(output, ::testing::Not(HasSubstr("damaged")));
}

// One flipped bit, wherever it is, gives the defaults.
TEST(WandFirmware, RefusesDamagedSettings) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Send("hz 300 400 480");
  const std::vector<uint8_t> good = board.Eeprom();
  for (size_t byte = 0; byte < 14; ++byte) {
    std::vector<uint8_t> damaged = good;
    damaged[byte] ^= static_cast<uint8_t>(1u << byte % 8);
    SimulatedBoard later("wand", damaged);
    later.Run(0.1);
    EXPECT_THAT(later.TakeOutput(), AllOf(HasSubstr("damaged"), HasSubstr("hz 500 500 500")))
        << "byte " << byte;
  }
}

// With a checksum that is right, but of the layout that the firmware had before light codes.
TEST(WandFirmware, RefusesSettingsOfAnotherLayout) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  std::vector<uint8_t> eeprom = board.Eeprom();
  const std::vector<uint8_t> stored = {1,    0x82, 0x5e, 0x2c, 0x01, 0x90, 0x01,
                                       0xe0, 0x01, 0x32, 0x64, 0x00, 0xac, 0x0d};
  std::ranges::copy(stored, eeprom.begin());
  SimulatedBoard later("wand", eeprom);
  later.Run(0.1);
  EXPECT_THAT(later.TakeOutput(), AllOf(HasSubstr("damaged"), HasSubstr("hz 500 500 500")));
}

TEST(WandFirmware, ButtonChangesFrequenciesAndBrightness) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Press(0.2);
  EXPECT_THAT(board.TakeOutput(), HasSubstr("hz 400 500 620"));
  ExpectBlinking(&board, {400, 500, 620}, 0.5);
  board.Press(0.2);
  ExpectBlinking(&board, {200, 200, 200}, 0.5);
  EXPECT_THAT(board.TakeOutput(), HasSubstr("hz 200 200 200, duty 50 %, brightness 100 %"));
  board.Press(1.1);
  EXPECT_THAT(board.TakeOutput(), HasSubstr("hz 200 200 200, duty 50 %, brightness 50 %"));
  board.Press(2.1);  // longer is not more
  EXPECT_THAT(board.TakeOutput(), HasSubstr("brightness 25 %"));
  SimulatedBoard later("wand", board.Eeprom());
  later.Run(0.1);
  EXPECT_THAT(later.TakeOutput(), HasSubstr("hz 200 200 200, duty 50 %, brightness 25 %"));
  later.Press(1.2);
  EXPECT_THAT(later.TakeOutput(), HasSubstr("brightness 100 %"));
  later.Press(0.1);
  ExpectBlinking(&later, {500, 500, 500}, 0.5);
}

// The number of flashes that follow says which choice it is.
TEST(WandFirmware, StatusLedCountsTheChoice) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Press(0.2);
  board.Press(0.2);
  const double begin_s = board.time_s();
  board.Run(2.4);
  const PinTrace trace = board.TraceSince(BoardPin::kD13, begin_s);
  EXPECT_EQ(std::ranges::count_if(trace, [](const PinChange& c) { return c.high; }), 3 + 1);
  EXPECT_TRUE(board.IsHigh(BoardPin::kD13));  // lit again, as with a good battery
}

TEST(WandFirmware, SaysThatTheBatteryIsLow) {
  SimulatedBoard board("wand");
  board.Run(1.2);
  double begin_s = board.time_s();
  board.Run(1);
  EXPECT_TRUE(board.IsHigh(BoardPin::kD13));
  EXPECT_TRUE(board.TraceSince(BoardPin::kD13, begin_s).empty());

  board.TakeOutput();
  board.SetBatteryMv(3450);
  board.Run(1.2);
  EXPECT_THAT(board.TakeOutput(), AllOf(HasSubstr("battery 34"), HasSubstr("low, charge it")));
  begin_s = board.time_s();
  board.Run(3);
  const PinSignal low = MeasureSignal(board.TraceSince(BoardPin::kD13, begin_s));
  EXPECT_NEAR(low.hz, 2, 0.2);
  EXPECT_NEAR(low.duty, 0.5, 0.05);
  ExpectBlinking(&board, {500, 500, 500}, 0.5);

  board.SetBatteryMv(3560);  // within the hysteresis
  board.Run(1.2);
  EXPECT_EQ(board.TakeOutput(), "");
  board.SetBatteryMv(3700);
  board.Run(1.2);
  EXPECT_THAT(board.TakeOutput(), HasSubstr("battery 369"));
}

TEST(WandFirmware, GoesDarkBeforeTheBatteryIsHarmed) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.SetBatteryMv(3250);
  board.Run(1.2);
  EXPECT_THAT(board.TakeOutput(), HasSubstr("empty, the spheres are dark"));
  double begin_s = board.time_s();
  board.Run(6.1);
  for (const BoardPin led : kLeds) {
    EXPECT_FALSE(board.IsHigh(led));
    EXPECT_TRUE(board.TraceSince(led, begin_s).empty());
  }
  const PinSignal empty = MeasureSignal(board.TraceSince(BoardPin::kD13, begin_s));
  EXPECT_NEAR(empty.hz, 0.5, 0.05);
  EXPECT_LT(empty.duty, 0.05);

  // New settings light nothing, nor does what a battery recovers by itself.
  board.Send("hz 400");
  board.SetBatteryMv(3600);
  begin_s = board.time_s();
  board.Run(1.2);
  for (const BoardPin led : kLeds) EXPECT_TRUE(board.TraceSince(led, begin_s).empty());
  board.SetBatteryMv(3800);
  board.Run(1.2);
  ExpectBlinking(&board, {400, 400, 400}, 0.5);
}

TEST(WandFirmware, WatchesNoBatteryIfTold) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  EXPECT_THAT(board.Send("low 0"), HasSubstr("low 0 mV"));
  board.SetBatteryMv(0);
  board.Run(1.2);
  ExpectBlinking(&board, {500, 500, 500}, 0.5);
}

}  // namespace
}  // namespace rigcal::testing::wand_firmware_test
