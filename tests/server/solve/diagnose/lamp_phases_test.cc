// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/lamp_phases.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace rigcal::server::lamp_phases_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kSigmaS = 5e-5;

struct Seen {
  std::string camera;
  int clock = 0;
  double late_s = 0;   // of its clock, beside what the calibration says
  double drift_s = 0;  // of its clock, over the recording
  double hz = 100.02;  // of the lamps
  int third = 0;       // which of the mains' phases its lamps hang on
  int seconds = 30;
  std::string session_id = "wave";
  double begin_s = 0.3;  // after the recording's
};

// What a camera that sees lamps reads, with noise of kSigmaS.
LampPhases Phases(const Seen& seen) {
  std::mt19937 random(static_cast<uint32_t>(17 + seen.clock));
  std::normal_distribution<double> noise(0, kSigmaS);
  LampPhases phases{.session_id = seen.session_id, .camera = seen.camera, .clock = seen.clock};
  const double period_s = 1 / seen.hz;
  for (int i = 0; i < seen.seconds; ++i) {
    const double middle_s = seen.begin_s + i + 0.5;
    const double phase_s = period_s * (std::round(middle_s / period_s) + seen.third / 3.0);
    const double clock_s = seen.late_s + seen.drift_s * i / seen.seconds;
    phases.moments.push_back(
        {.rig_time_ns = int64_t{1'790'000'000'000'000'000} +
                        std::llround(1e9 * (phase_s + clock_s + noise(random))),
         .period_s = period_s,
         .sigma_s = kSigmaS});
  }
  return phases;
}

std::vector<Finding> Find(const std::vector<Seen>& all) {
  std::vector<LampPhases> cameras;
  for (const Seen& seen : all) cameras.push_back(Phases(seen));
  return FindLampContradictions(std::move(cameras));
}

TEST(LampPhases, SaysNothingOfClocksThatAgree) {
  EXPECT_THAT(Find({}), IsEmpty());
  EXPECT_THAT(Find({{.camera = "a", .clock = 0}}), IsEmpty());
  EXPECT_THAT(Find({{.camera = "a", .clock = 0},
                    {.camera = "b", .clock = 1, .late_s = 3e-4, .third = 1, .begin_s = 0.7},
                    {.camera = "c", .clock = 2, .late_s = -1e-4, .drift_s = 3e-4, .third = 2}}),
              IsEmpty());
}

TEST(LampPhases, NamesADifference) {
  const std::vector<Finding> findings = Find(
      {{.camera = "b", .clock = 0, .late_s = 1.2e-3, .third = 2}, {.camera = "a", .clock = 1}});
  ASSERT_THAT(findings, SizeIs(1));
  EXPECT_EQ(findings[0].kind, FindingKind::kLampFlickerContradicts);
  EXPECT_EQ(findings[0].camera, "b");
  EXPECT_NEAR(findings[0].value, 1.2, 0.1);
  EXPECT_EQ(findings[0].unit, "ms");
  EXPECT_THAT(findings[0].advice,
              AllOf(HasSubstr("lamps of 100 Hz"), HasSubstr("later"), HasSubstr("camera a"),
                    HasSubstr("multiple of 3.33 ms"), HasSubstr("either may be the one")));
}

TEST(LampPhases, NamesTheCameraThatMostContradict) {
  const std::vector<Finding> findings = Find({{.camera = "a", .clock = 0, .late_s = -1.1e-3},
                                              {.camera = "b", .clock = 1},
                                              {.camera = "c", .clock = 2},
                                              {.camera = "d", .clock = 3}});
  ASSERT_THAT(findings, SizeIs(1));
  EXPECT_EQ(findings[0].camera, "a");
  EXPECT_NEAR(findings[0].value, -1.1, 0.1);
  EXPECT_THAT(findings[0].advice, ::testing::Not(HasSubstr("either may be the one")));
}

// Over more than a third of a period.
TEST(LampPhases, NamesADrift) {
  const std::vector<Finding> findings =
      Find({{.camera = "a", .clock = 0}, {.camera = "b", .clock = 1, .drift_s = -6e-3}});
  ASSERT_THAT(findings, SizeIs(1));
  EXPECT_EQ(findings[0].camera, "b");
  EXPECT_NEAR(findings[0].value, -4, 0.3);  // from the first third to the last
  EXPECT_THAT(findings[0].advice, AllOf(HasSubstr("get 4.0"), HasSubstr("earlier")));
}

TEST(LampPhases, ComparesEachFrequencyWithItself) {
  EXPECT_THAT(
      Find({{.camera = "a", .clock = 0}, {.camera = "b", .clock = 1, .late_s = 1.2e-3, .hz = 120}}),
      IsEmpty());
  // A third of 100 Hz, which only lamps of 120 Hz tell from none.
  LampPhases a = Phases({.camera = "a", .clock = 0});
  LampPhases b = Phases({.camera = "b", .clock = 1, .late_s = 1 / 300.06});
  EXPECT_THAT(FindLampContradictions({a, b}), IsEmpty());
  for (const LampMoment& moment : Phases({.camera = "a", .clock = 2, .hz = 120.01}).moments) {
    a.moments.push_back(moment);
  }
  for (const LampMoment& moment :
       Phases({.camera = "b", .clock = 3, .late_s = 1 / 300.06, .hz = 120.01}).moments) {
    b.moments.push_back(moment);
  }
  const std::vector<Finding> findings = FindLampContradictions({a, b});
  ASSERT_THAT(findings, SizeIs(1));
  EXPECT_NEAR(findings[0].value, 1e3 / 300.06 - 1e3 / 360.03, 0.1);
  EXPECT_THAT(findings[0].advice, HasSubstr("lamps of 120 Hz"));
}

TEST(LampPhases, ComparesOnlyWhatCanBeCompared) {
  constexpr double kLate = 1.2e-3;
  const Seen a{.camera = "a", .clock = 0};
  EXPECT_THAT(Find({a, {.camera = "b", .clock = 0, .late_s = kLate}}), IsEmpty());  // one clock
  EXPECT_THAT(Find({a, {.camera = "b", .clock = 1, .late_s = kLate, .session_id = "other"}}),
              IsEmpty());
  EXPECT_THAT(Find({a, {.camera = "b", .clock = 1, .late_s = kLate, .seconds = 4}}), IsEmpty());
  EXPECT_THAT(Find({a, {.camera = "b", .clock = 1, .late_s = kLate, .begin_s = 40}}), IsEmpty());
  EXPECT_THAT(Find({a, {.camera = "b", .clock = 1, .late_s = kLate, .seconds = 5}}), SizeIs(1));
}

TEST(LampPhases, IsNoSurerThanItsSigmas) {
  LampPhases a = Phases({.camera = "a", .clock = 0});
  LampPhases b = Phases({.camera = "b", .clock = 1, .late_s = 1.2e-3});
  b.offset_sigma_s = 3e-4;
  EXPECT_THAT(FindLampContradictions({a, b}), IsEmpty());
  b.offset_sigma_s = 0;
  for (LampMoment& moment : b.moments) moment.sigma_s = 3e-4;
  EXPECT_THAT(FindLampContradictions({a, b}), IsEmpty());
}

// Whatever an agent has sent.
TEST(LampPhases, StandsWrongMoments) {
  LampPhases a = Phases({.camera = "a", .clock = 0});
  LampPhases b = a;
  b.camera = "b";
  b.clock = 1;
  for (size_t i = 0; i < b.moments.size(); ++i) {
    if (i % 3 == 0) b.moments[i].period_s = 0;
    if (i % 3 == 1) b.moments[i].rig_time_ns = std::numeric_limits<int64_t>::max();
    if (i % 3 == 2) b.moments[i].rig_time_ns = std::numeric_limits<int64_t>::min();
  }
  EXPECT_THAT(FindLampContradictions({a, b}), IsEmpty());
}

}  // namespace
}  // namespace rigcal::server::lamp_phases_test
