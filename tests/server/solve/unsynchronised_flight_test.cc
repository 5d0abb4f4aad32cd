// SPDX-License-Identifier: Apache-2.0
// The whole solve of one point before cameras that nothing synchronises, with rolling shutters.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_flight.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::unsynchronised_flight_test {
namespace {

using ::rigcal::testing::IsOk;

SimulatedFlightOptions DriftingClocks(uint32_t seed) {
  SimulatedFlightOptions options;
  options.seed = seed;
  options.duration_s = 100;
  options.camera_count = 4;
  options.noise_px = 0.2;
  options.largest_rate_ppm = 900;
  options.focal_sigma_rel = 0.002;
  return options;
}

// Over the halves of a flight a clock that drifts moves more than image rows do.
TEST(UnsynchronisedFlight, RollingShuttersBehindDriftingClocksAreModelled) {
  const SimulatedFlight flight = FlyPoint(DriftingClocks(23));
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  options.trajectory = TrajectoryChoice::kInterpolated;
  const CalibrationOutcome outcome = Calibrate(flight.input, options);
  ASSERT_THAT(outcome.result, IsOk());
  for (size_t c = 0; c < flight.cameras.size(); ++c) {
    const CalibratedCamera& camera = outcome.result->cameras[c];
    SCOPED_TRACE(camera.camera);
    EXPECT_NEAR(camera.line_delay_s, flight.cameras[c].line_delay_s,
                0.2 * flight.cameras[c].line_delay_s);
    // Read-out fits into the period.
    EXPECT_LE(camera.line_delay_s * 1080, 1.001 / flight.cameras[c].rate_hz);
  }
  // Taken into account, and no fault any more.
  EXPECT_GT(
      std::ranges::count(outcome.result->findings, FindingKind::kRollingShutter, &Finding::kind),
      0);
  for (const Finding& finding : outcome.result->findings) {
    if (finding.kind != FindingKind::kRollingShutter) continue;
    EXPECT_EQ(finding.severity, FindingSeverity::kInfo) << finding.advice;
  }
}

// Refined lenses fit held-out pixels better, by lens errors that one point far away hardly tells
// apart, and put the cameras elsewhere.
TEST(UnsynchronisedFlight, LensesThatOnePointHardlyTellsApartAreKept) {
  const SimulatedFlight flight = FlyPoint(DriftingClocks(21));
  CalibrationOptions options;
  options.trajectory = TrajectoryChoice::kInterpolated;
  const CalibrationOutcome outcome = Calibrate(flight.input, options);
  ASSERT_THAT(outcome.result, IsOk());
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    EXPECT_FALSE(camera.intrinsics_refined) << camera.camera;
  }
}

}  // namespace
}  // namespace rigcal::server::unsynchronised_flight_test
