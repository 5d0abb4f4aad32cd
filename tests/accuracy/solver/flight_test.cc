// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "tests/accuracy/solver/flight_experiment.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::flight_test {
namespace {

// Published with rolling shutters modelled, on detections of its own (arXiv 2003.04784, Table IV):
// mean 7.3, rms 8.5, median 6.1 cm.
TEST(FlightTest, PathOfThePointIsWithinCentimetresOfRtk) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  ASSERT_OK_AND_ASSIGN(const FlightRun run, RunFlight(data, CalibrationOptions()));
  EXPECT_GT(run.errors.count, 4000u);
  EXPECT_LT(run.errors.mean_m, 0.08);
  EXPECT_LT(run.errors.rms_m, 0.10);
  EXPECT_LT(run.errors.median_m, 0.06);
  // One point far away says little about lenses: they stay as they were given.
  for (const CalibratedCamera& camera : run.result.cameras) {
    EXPECT_FALSE(camera.intrinsics_refined) << camera.camera;
  }
  // None of the cameras moved, and their lenses are what their files say.
  for (const Finding& finding : run.result.findings) {
    EXPECT_NE(finding.kind, FindingKind::kCameraMoved) << finding.advice;
    EXPECT_NE(finding.kind, FindingKind::kWrongIntrinsics) << finding.advice;
    EXPECT_NE(finding.kind, FindingKind::kWrongLensModel) << finding.advice;
  }
}

}  // namespace
}  // namespace rigcal::accuracy::flight_test
