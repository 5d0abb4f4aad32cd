// SPDX-License-Identifier: Apache-2.0
#include "common/camera/fit_intrinsics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/status/status.h"
#include "common/camera/camera_model.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::fit_intrinsics_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr double kWidthPx = 1280, kHeightPx = 1024;

// Of a grid over the part of the image within `radius_px` of the principal point.
std::vector<RayPixel> RaysOf(const Intrinsics& lens, double radius_px) {
  std::vector<RayPixel> rays;
  for (double x = 0; x < kWidthPx; x += 40) {
    for (double y = 0; y < kHeightPx; y += 40) {
      if (Eigen::Vector2d(x - lens.cx_px, y - lens.cy_px).norm() > radius_px) continue;
      const auto ray = Undistort(lens, {x, y});
      if (ray.ok()) rays.push_back({ray->homogeneous(), {x, y}});
    }
  }
  return rays;
}

const Intrinsics kBrownConrady{DistortionModel::kBrownConrady, 900, 905, 630, 520,
                               {-0.2, 0.1, 1e-4, -2e-4, -0.03}};
const Intrinsics kFisheye{DistortionModel::kFisheye, 560, 562, 636, 514, {-0.02, 0.004, 0, 0}};

TEST(FitIntrinsics, FindsTheLensThatMadeTheRays) {
  Intrinsics start = kFisheye;
  start.fx_px = start.fy_px = 700;
  start.distortion = {};
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFit fit,
                       FitIntrinsics(DistortionModel::kFisheye, RaysOf(kFisheye, 700), start));
  EXPECT_LT(fit.rms_px, 1e-6);
  EXPECT_NEAR(fit.intrinsics.fx_px, 560, 1e-3);
  EXPECT_NEAR(fit.intrinsics.cy_px, 514, 1e-3);
  EXPECT_NEAR(fit.intrinsics.distortion[0], -0.02, 1e-6);
}

TEST(FitIntrinsics, RationalModelHoldsBrownConradyExactly) {
  ASSERT_OK_AND_ASSIGN(
      const IntrinsicsFit fit,
      FitIntrinsics(DistortionModel::kRational, RaysOf(kBrownConrady, 500), kBrownConrady));
  EXPECT_LT(fit.rms_px, 1e-9);
}

TEST(FitIntrinsics, BrownConradyDescribesAWideFisheyeOnlyRoughly) {
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFit brown, FitIntrinsics(DistortionModel::kBrownConrady,
                                                                RaysOf(kFisheye, 600), kFisheye));
  EXPECT_GT(brown.rms_px, 0.1);
  EXPECT_LT(brown.rms_px, 20);
  ASSERT_OK_AND_ASSIGN(
      const IntrinsicsFit back,
      FitIntrinsics(DistortionModel::kFisheye, RaysOf(kFisheye, 600), brown.intrinsics));
  EXPECT_LT(back.rms_px, 1e-3);
}

TEST(FitIntrinsics, RefusesTooFewRays) {
  const std::vector<RayPixel> rays(3, {{0, 0, 1}, {640, 512}});
  EXPECT_THAT(FitIntrinsics(DistortionModel::kFisheye, rays, kFisheye).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("too few")));
}

}  // namespace
}  // namespace rigcal::fit_intrinsics_test
