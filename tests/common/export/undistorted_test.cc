// SPDX-License-Identifier: Apache-2.0
#include "common/export/undistorted.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/export/calibration_export.h"
#include "tests/common/export/exported_rigs.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::undistorted_test {
namespace {

using ::rigcal::testing::CalibrationOfLens;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::TestLens;

TEST(Undistorted, IsHeldByEveryFormat) {
  for (const TestLens lens : {TestLens::kBrown5, TestLens::kRational, TestLens::kFisheye}) {
    const v1::Calibration distorted = CalibrationOfLens(lens, {"left", "right"}, true);
    EXPECT_FALSE((*FindCalibrationExportFormat("usd"))->make(distorted).ok());
    for (const CalibrationExportFormat& format : CalibrationExportFormats()) {
      EXPECT_THAT(format.make(Undistorted(distorted)), IsOk()) << format.name;
    }
  }
}

TEST(Undistorted, KeepsCameraMatrixAndItsSigmas) {
  v1::Calibration before = CalibrationOfLens(TestLens::kFisheye, {"left"});
  for (const double sigma : {1.0, 2.0, 3.0, 4.0, 0.1, 0.1, 0.1, 0.1}) {
    before.mutable_cameras(0)->mutable_uncertainty()->add_intrinsics_sigma(sigma);
  }
  const v1::Calibration after = Undistorted(before);
  EXPECT_EQ(after.cameras(0).intrinsics().fx_px(), before.cameras(0).intrinsics().fx_px());
  EXPECT_EQ(after.cameras(0).intrinsics().cy_px(), before.cameras(0).intrinsics().cy_px());
  EXPECT_THAT(after.cameras(0).uncertainty().intrinsics_sigma(),
              ::testing::ElementsAre(1, 2, 3, 4));
}

}  // namespace
}  // namespace rigcal::undistorted_test
