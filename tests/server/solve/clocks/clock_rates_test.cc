// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/clock_rates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace rigcal::server::clock_rates_test {
namespace {

constexpr double kPpm = 1e-6;

std::vector<RateEstimate> Clocks(const std::vector<double>& rates_ppm,
                                 const std::string& session_id = "a") {
  std::vector<RateEstimate> clocks;
  for (const double rate : rates_ppm) clocks.push_back({session_id, kPpm * rate, 60});
  return clocks;
}

std::vector<bool> Find(const std::vector<RateEstimate>& clocks, double sigma_ppm = 2) {
  return FindOwnRates(clocks, [sigma_ppm](size_t, size_t) { return kPpm * sigma_ppm; });
}

TEST(FindOwnRates, NamesOnlyTheClockThatRunsDifferently) {
  EXPECT_EQ(Find(Clocks({0, 2, 50, -1, 3})), (std::vector<bool>{false, false, true, false, false}));
}

TEST(FindOwnRates, TheClockTheOthersWereMeasuredAgainstMayBeTheOne) {
  EXPECT_EQ(Find(Clocks({0, -49, -51, -50})), (std::vector<bool>{true, false, false, false}));
}

TEST(FindOwnRates, OfTwoClocksTheOneWithoutARateKeepsNone) {
  EXPECT_EQ(Find(Clocks({0, 50})), (std::vector<bool>{false, true}));
  EXPECT_EQ(Find(Clocks({-50, 0})), (std::vector<bool>{true, false}));
}

TEST(FindOwnRates, WhereManyStandOutAllAreOscillatorsOfTheirOwn) {
  std::vector<RateEstimate> clocks = Clocks({0, 2, -20, 3, 40});
  clocks[0].estimated = false;
  EXPECT_EQ(Find(clocks), (std::vector<bool>{false, true, true, true, true}));
}

TEST(FindOwnRates, SessionsAreHeldApart) {
  std::vector<RateEstimate> clocks = Clocks({0, 50, 50}, "a");
  for (const RateEstimate& other : Clocks({0, 1, 0}, "b")) clocks.push_back(other);
  EXPECT_EQ(Find(clocks), (std::vector<bool>{true, false, false, false, false, false}));
}

TEST(FindOwnRates, AsksForFiveSigmasAndADriftThatCanBeSeen) {
  EXPECT_EQ(Find(Clocks({0, 50, 1}), 11), (std::vector<bool>{false, false, false}));
  EXPECT_EQ(Find(Clocks({0, 6, 0}), 1), (std::vector<bool>{false, false, false}));  // 0.36 ms
  EXPECT_EQ(Find(Clocks({0, 7, 0}), 1), (std::vector<bool>{false, true, false}));
  std::vector<RateEstimate> brief = Clocks({0, -605, 1});
  brief[1].span_s = 0.5;
  EXPECT_EQ(Find(brief), (std::vector<bool>{false, false, false}));
}

TEST(FindOwnRates, WhatIsNotKnownMakesNoRate) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(Find(Clocks({0, 50, 0}), 0), (std::vector<bool>{false, false, false}));
  EXPECT_EQ(Find(Clocks({0, 50, 0}), nan), (std::vector<bool>{false, false, false}));
  EXPECT_EQ(Find(Clocks({0, 50, 0}), INFINITY), (std::vector<bool>{false, false, false}));
  EXPECT_TRUE(Find({}).empty());
}

}  // namespace
}  // namespace rigcal::server::clock_rates_test
