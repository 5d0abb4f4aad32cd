// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "tests/deploy/wand/simulated_board.h"

namespace rigcal::testing::wand_code_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr BoardPin kLed1 = BoardPin::kD9;
constexpr double kPlaceS = 10e-6;  // how exactly every switch is in its place
constexpr int kTicksPerS = 2'000'000;
constexpr int kTicksPerBit = kTicksPerS / 10;

// The first `count` bits of wand `number`'s code.
std::vector<int> CodeBits(int number, size_t count) {
  constexpr unsigned kFirst = 0x6B275;
  constexpr size_t kDegree = 20;
  const std::vector<std::vector<size_t>> taps = {{3, 0},        {12, 8, 1, 0},  {13, 7, 2, 0},
                                                 {15, 9, 2, 0}, {17, 11, 2, 0}, {17, 6, 3, 0},
                                                 {16, 7, 3, 0}, {11, 9, 3, 0}};
  std::vector<int> bits(std::max(count, kDegree));
  for (size_t n = 0; n < bits.size(); ++n) {
    if (n < kDegree) {
      bits[n] = static_cast<int>(kFirst >> n & 1);
      continue;
    }
    for (const size_t tap : taps.at(static_cast<size_t>(number - 1))) {
      bits[n] ^= bits[n - kDegree + tap];
    }
  }
  bits.resize(count);
  return bits;
}

struct Blinking {
  int number = 0;  // of the code; 0: none
  int hz = 500;
  int duty_pct = 50;
};

// Every switch of an LED that has blinked by `blinking` from `start_s` to `end_s`.
PinTrace ExpectedTrace(const Blinking& blinking, double start_s, double end_s) {
  const int period = static_cast<int>(std::lround(static_cast<double>(kTicksPerS) / blinking.hz));
  const int lit = static_cast<int>(std::lround(0.01 * blinking.duty_pct * period));
  const int tenth = static_cast<int>(std::lround(0.1 * period));
  const auto bit_count = static_cast<size_t>(10 * (end_s - start_s)) + 2;
  const std::vector<int> bits =
      blinking.number == 0 ? std::vector<int>(bit_count) : CodeBits(blinking.number, bit_count);
  PinTrace trace;
  for (int64_t rise = 0;; rise += period) {
    const int cut = bits.at(static_cast<size_t>(rise / kTicksPerBit)) * tenth;
    for (const bool high : {true, false}) {
      const int64_t ticks = high ? rise + cut : rise + lit - cut;
      const double time_s = start_s + static_cast<double>(ticks) / kTicksPerS;
      if (time_s >= end_s) return trace;
      trace.push_back({time_s, high});
    }
  }
}

void ExpectTrace(const PinTrace& trace, const PinTrace& expected) {
  ASSERT_NEAR(static_cast<double>(trace.size()), static_cast<double>(expected.size()), 1);
  const size_t count = std::min(trace.size(), expected.size());
  for (size_t i = 0; i < count; ++i) {
    ASSERT_EQ(trace[i].high, expected[i].high) << "switch " << i;
    ASSERT_NEAR(trace[i].time_s, expected[i].time_s, kPlaceS)
        << "switch " << i << ", " << trace[i].time_s - expected[0].time_s << " s after the start";
  }
}

// When LED 1 began to blink as it does now: its last rise that follows no other after one period.
double StartS(const SimulatedBoard& board, int hz) {
  double start_s = std::numeric_limits<double>::quiet_NaN(), last_rise_s = -1;
  for (const PinChange& change : board.TraceSince(kLed1, 0)) {
    if (!change.high) continue;
    if (std::abs(change.time_s - last_rise_s - 1.0 / hz) > 0.001 / hz) start_s = change.time_s;
    last_rise_s = change.time_s;
  }
  return start_s;
}

// Since they began, the LEDs have blinked by these frequencies, and LED 2 with the code.
void ExpectCode(const SimulatedBoard& board, int number, const std::array<int, 3>& hz,
                int duty_pct = 50) {
  const double start_s = StartS(board, hz[0]), end_s = board.time_s();
  const std::array<BoardPin, 3> leds = {BoardPin::kD9, BoardPin::kD10, BoardPin::kD3};
  for (size_t i = 0; i < leds.size(); ++i) {
    SCOPED_TRACE(::testing::Message() << "LED " << i + 1 << " at " << hz[i] << " Hz, code "
                                      << number << ", from " << start_s << " s on");
    const Blinking blinking{i == 1 ? number : 0, hz[i], duty_pct};
    ExpectTrace(board.TraceSince(leds[i], start_s - kPlaceS),
                ExpectedTrace(blinking, start_s, end_s));
  }
}

TEST(WandCode, IsOffWhenNew) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  EXPECT_THAT(board.TakeOutput(), HasSubstr("low 3500 mV, code 0\r\n"));
  board.Run(2);
  ExpectCode(board, 0, {500, 500, 500});
}

TEST(WandCode, EveryNumberSendsItsSequence) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  for (int number = 1; number <= 8; ++number) {
    EXPECT_THAT(board.Send("code " + std::to_string(number)),
                HasSubstr("mV, code " + std::to_string(number) + "\r\n"));
    board.Run(4.5);  // 45 bits: 25 more than the start, which all codes share
    ExpectCode(board, number, {500, 500, 500});
  }
  EXPECT_THAT(board.Send("code 0"), HasSubstr("code 0\r\n"));
  board.Run(1);
  ExpectCode(board, 0, {500, 500, 500});
}

// For more than 65536 periods.
TEST(WandCode, StaysInPlace) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Send("hz 1000");
  board.Send("code 3");
  board.Run(67);
  ExpectCode(board, 3, {1000, 1000, 1000});
}

// A period of 400 or 620 Hz is no whole part of a bit: those that begin within it belong to it.
TEST(WandCode, HoldsAtEveryFrequency) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Send("code 2");
  for (const std::array<int, 3> hz :
       {std::array{400, 500, 620}, std::array{500, 620, 400}, std::array{500, 400, 620},
        std::array{100, 100, 100}, std::array{1000, 1000, 1000}, std::array{300, 617, 123}}) {
    board.Send("hz " + std::to_string(hz[0]) + " " + std::to_string(hz[1]) + " " +
               std::to_string(hz[2]));
    board.Run(hz[1] == 500 ? 31 : 6);
    ExpectCode(board, 2, hz);
  }
}

TEST(WandCode, HoldsAtTheEndsOfItsDuty) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Send("hz 1000");
  board.Send("code 5");
  for (const int duty_pct : {40, 80}) {
    EXPECT_THAT(board.Send("duty " + std::to_string(duty_pct)), StartsWith("ok: "));
    board.Run(4);
    ExpectCode(board, 5, {1000, 1000, 1000}, duty_pct);
  }
}

TEST(WandCode, TypingMovesNoBit) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Send("hz 1000");
  board.Send("code 4");
  for (int i = 0; i < 10; ++i) {
    board.Send("help");
    board.Send("show");
    board.Send("hz 99");
    board.Send("xyz");
  }
  ExpectCode(board, 4, {1000, 1000, 1000});
}

TEST(WandCode, BeginsAgainWithTheBlinking) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Send("code 6");
  board.Run(2.34);
  const double first_s = StartS(board, 500);
  board.Send("brightness 50");
  board.Run(3);
  EXPECT_GT(StartS(board, 500), first_s + 2);
  ExpectCode(board, 6, {500, 500, 500});
  board.Press(0.2);
  board.Run(3);
  ExpectCode(board, 6, {400, 500, 620});

  board.SetBatteryMv(3200);
  board.Run(1.2);
  const double dark_s = board.time_s();
  board.Run(1.5);
  EXPECT_TRUE(board.TraceSince(BoardPin::kD10, dark_s).empty());
  board.SetBatteryMv(4000);
  board.Run(5);
  EXPECT_GT(StartS(board, 400), dark_s);
  ExpectCode(board, 6, {400, 500, 620});
}

TEST(WandCode, IsKeptWithoutPower) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Send("code 8");
  SimulatedBoard later("wand", board.Eeprom());
  later.Run(5);
  EXPECT_THAT(later.TakeOutput(), HasSubstr("code 8\r\n"));
  ExpectCode(later, 8, {500, 500, 500});
  EXPECT_THAT(later.Send("reset"), HasSubstr("code 0\r\n"));
}

TEST(WandCode, RefusesADutyThatCannotCarryIt) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  for (const int duty_pct : {39, 81}) {
    board.Send("duty " + std::to_string(duty_pct));
    EXPECT_EQ(board.Send("code 1"), "error: code needs a duty of 40 to 80 %, not " +
                                        std::to_string(duty_pct) + "; type duty 50 first\r\n");
    EXPECT_THAT(board.Send("show"), HasSubstr("code 0\r\n"));
    EXPECT_THAT(board.Send("code 0"), StartsWith("ok: "));  // no code fits every duty
  }
  board.Send("duty 50");
  board.Send("code 1");
  for (const int duty_pct : {39, 81}) {
    EXPECT_EQ(board.Send("duty " + std::to_string(duty_pct)),
              "error: code needs a duty of 40 to 80 %, not " + std::to_string(duty_pct) +
                  "; type code 0 first\r\n");
  }
  EXPECT_THAT(board.Send("show"), AllOf(HasSubstr("duty 50 %"), HasSubstr("code 1\r\n")));
  board.Run(1);
  ExpectCode(board, 1, {500, 500, 500});  // what was refused has not begun it again
}

TEST(WandCode, RefusesNumbersThatAreNone) {
  SimulatedBoard board("wand");
  board.Run(0.3);
  board.Send("code 7");
  const struct {
    const char* line;
    const char* answer;
  } cases[] = {
      {"code", "error: code takes 1 number(s), not 0; try help\r\n"},
      {"code 1 2", "error: code takes 1 number(s), not 2; try help\r\n"},
      {"code 9", "error: code can be 0 to 8, not 9\r\n"},
      {"code 257", "error: code can be 0 to 8, not 257\r\n"},  // 256 + 1
      {"code off", "error: off is no whole number from 0 to 65535\r\n"},
  };
  for (const auto& entry : cases) EXPECT_EQ(board.Send(entry.line), entry.answer) << entry.line;
  EXPECT_THAT(board.Send("show"), HasSubstr("code 7\r\n"));
}

}  // namespace
}  // namespace rigcal::testing::wand_code_test
