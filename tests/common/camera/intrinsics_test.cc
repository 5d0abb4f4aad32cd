// SPDX-License-Identifier: Apache-2.0
#include "common/camera/intrinsics.h"

#include <limits>

#include "tests/testing/status_matchers.h"

namespace rigcal::intrinsics_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const ImageSize kSize{1280, 1024};

Intrinsics Good() {
  return {DistortionModel::kBrownConrady, 1250, 1251, 640, 512, {-0.2, 0.2, 0, 0, -0.1}};
}

TEST(Intrinsics, AcceptsEachModelWithItsCoefficientsOrNone) {
  for (const DistortionModel model :
       {DistortionModel::kBrownConrady, DistortionModel::kRational, DistortionModel::kFisheye}) {
    Intrinsics intrinsics = Good();
    intrinsics.model = model;
    intrinsics.distortion.assign(static_cast<size_t>(CoefficientCount(model)), 0.01);
    EXPECT_THAT(intrinsics.Validate(kSize), IsOk());
    intrinsics.distortion.clear();
    EXPECT_THAT(intrinsics.Validate(kSize), IsOk());
    intrinsics.distortion.assign(static_cast<size_t>(CoefficientCount(model)) + 1, 0.01);
    EXPECT_THAT(intrinsics.Validate(kSize),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("coefficients")));
  }
}

TEST(Intrinsics, RefusesFocalLengthsThatAreNotPositiveAndFinite) {
  for (const double bad : {0.0, -1250.0, kNan, kInfinity}) {
    Intrinsics intrinsics = Good();
    intrinsics.fx_px = bad;
    EXPECT_THAT(intrinsics.Validate(kSize),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("fx_px")));
    intrinsics = Good();
    intrinsics.fy_px = bad;
    EXPECT_THAT(intrinsics.Validate(kSize),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("fy_px")));
  }
}

TEST(Intrinsics, NamesACameraMatrixInSharesOfTheImage) {
  Intrinsics intrinsics = Good();
  intrinsics.fx_px = 0.98;
  intrinsics.fy_px = 1.22;
  intrinsics.cx_px = intrinsics.cy_px = 0.5;
  EXPECT_THAT(intrinsics.Validate(kSize), StatusIs(absl::StatusCode::kInvalidArgument,
                                                   HasSubstr("shares of the image, not pixels")));
  intrinsics.cx_px = 640;
  EXPECT_THAT(intrinsics.Validate(kSize), IsOk());
}

TEST(Intrinsics, AllowsAPrincipalPointOutsideTheImageButNotFarOutside) {
  Intrinsics intrinsics = Good();
  intrinsics.cx_px = -1279;
  EXPECT_THAT(intrinsics.Validate(kSize), IsOk());
  for (const double bad : {-1281.0, 2561.0, kNan, -kInfinity}) {
    intrinsics.cx_px = bad;
    EXPECT_THAT(intrinsics.Validate(kSize),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("cx_px")))
        << bad;
  }
}

TEST(Intrinsics, LeavesOutThePrincipalPointWhenTheSizeIsNotKnown) {
  EXPECT_THAT(Good().Validate(ImageSize{}), IsOk());
}

TEST(Intrinsics, ListsEveryFault) {
  Intrinsics intrinsics = Good();
  intrinsics.fx_px = 0;
  intrinsics.cy_px = kNan;
  intrinsics.distortion[3] = kInfinity;
  EXPECT_THAT(intrinsics.Validate(kSize),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("fx_px"), HasSubstr("cy_px"), HasSubstr("distortion[3]"))));
}

TEST(Intrinsics, RefusesAnUnknownModel) {
  Intrinsics intrinsics = Good();
  intrinsics.model = static_cast<DistortionModel>(77);
  EXPECT_THAT(intrinsics.Validate(kSize),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("77")));
}

TEST(ImageSize, RefusesZeroAndAbsurdSides) {
  EXPECT_THAT((ImageSize{1, kMaxImageSidePx}).Validate(), IsOk());
  for (const ImageSize bad : {ImageSize{0, 10}, ImageSize{10, 0}, ImageSize{65537, 10},
                              ImageSize{10, std::numeric_limits<uint32_t>::max()}}) {
    EXPECT_THAT(bad.Validate(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("size")));
  }
}

}  // namespace
}  // namespace rigcal::intrinsics_test
