// SPDX-License-Identifier: Apache-2.0
#include "tests/deploy/wand/pin_trace.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::testing::pin_trace_test {
namespace {

PinTrace Pulses(const std::vector<double>& rises_s, double high_s) {
  PinTrace trace;
  for (const double rise_s : rises_s) {
    trace.push_back({rise_s, true});
    trace.push_back({rise_s + high_s, false});
  }
  return trace;
}

TEST(PinTrace, MeasuresEvenPulses) {
  const PinSignal signal = MeasureSignal(Pulses({1.000, 1.002, 1.004, 1.006}, 0.0005));
  EXPECT_EQ(signal.rises, 4);
  EXPECT_NEAR(signal.hz, 500, 1e-6);
  EXPECT_NEAR(signal.jitter_s, 0, 1e-12);
  EXPECT_NEAR(signal.duty, 0.25, 1e-9);
  EXPECT_NEAR(signal.shortest_high_s, 0.0005, 1e-12);
}

TEST(PinTrace, SeesOneLateRise) {
  const PinSignal signal = MeasureSignal(Pulses({1.000, 1.00203, 1.004, 1.006}, 0.0005));
  EXPECT_NEAR(signal.hz, 500, 1e-6);
  EXPECT_NEAR(signal.jitter_s, 30e-6, 1e-9);
}

TEST(PinTrace, SeesOneLongPulse) {
  PinTrace trace = Pulses({1.000, 1.002, 1.004, 1.006}, 0.0005);
  trace[3].time_s += 1e-4;
  const PinSignal signal = MeasureSignal(trace);
  EXPECT_NEAR(signal.longest_high_s, 0.0006, 1e-12);
  EXPECT_NEAR(signal.duty, 0.25 + 1e-4 / 0.006, 1e-9);
}

TEST(PinTrace, IgnoresCutEnds) {
  PinTrace trace = Pulses({1.000, 1.002, 1.004, 1.006}, 0.001);
  trace.insert(trace.begin(), {0.9999, false});
  trace.pop_back();
  const PinSignal signal = MeasureSignal(trace);
  EXPECT_NEAR(signal.duty, 0.5, 1e-9);
  EXPECT_NEAR(signal.hz, 500, 1e-6);
}

TEST(PinTrace, MeasuresNothingWithoutPeriods) {
  EXPECT_TRUE(std::isnan(MeasureSignal({}).hz));
  const PinSignal signal = MeasureSignal(Pulses({1, 2}, 0.1));
  EXPECT_EQ(signal.rises, 2);
  EXPECT_TRUE(std::isnan(signal.hz));
  EXPECT_TRUE(std::isnan(signal.jitter_s));
}

}  // namespace
}  // namespace rigcal::testing::pin_trace_test
