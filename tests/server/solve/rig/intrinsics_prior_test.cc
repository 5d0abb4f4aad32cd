// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/intrinsics_prior.h"

#include <gtest/gtest.h>

#include "common/camera/intrinsics_vector.h"

namespace rigcal::server::intrinsics_prior_test {
namespace {

CameraDescription Description(DistortionModel model) {
  CameraDescription description;
  description.camera = "a";
  description.image_size_px = {1280, 800};
  description.intrinsics = Intrinsics{model, 900, 1100, 640, 400, {}};
  description.intrinsics->distortion.assign(static_cast<size_t>(CoefficientCount(model)), 0.01);
  return description;
}

BundleCamera Freed(const CameraDescription& description) {
  BundleCamera camera;
  camera.model = description.intrinsics->model;
  camera.intrinsics = ToVector(*description.intrinsics);
  camera.intrinsics[0] += 5;  // where a solve has got to
  SetIntrinsicsPrior(description, &camera);
  return camera;
}

TEST(SetIntrinsicsPrior, FreesThemAroundTheGivenOnes) {
  for (const DistortionModel model :
       {DistortionModel::kBrownConrady, DistortionModel::kRational, DistortionModel::kFisheye}) {
    const CameraDescription description = Description(model);
    const BundleCamera camera = Freed(description);
    EXPECT_FALSE(camera.intrinsics_fixed);
    EXPECT_EQ(camera.intrinsics_mean, ToVector(*description.intrinsics));
    EXPECT_EQ(camera.intrinsics[0], 905);
    ASSERT_EQ(camera.intrinsics_sigma.size(), IntrinsicsSize(model));
    EXPECT_TRUE((camera.intrinsics_sigma.array() > 0).all());
  }
}

TEST(SetIntrinsicsPrior, ScalesWithFocalLengthsAndImageWidth) {
  const IntrinsicsVector sigma =
      Freed(Description(DistortionModel::kBrownConrady)).intrinsics_sigma;
  EXPECT_DOUBLE_EQ(sigma[0], 0.02 * 900);
  EXPECT_DOUBLE_EQ(sigma[1], 0.02 * 1100);
  EXPECT_DOUBLE_EQ(sigma[2], 12.8);
  EXPECT_DOUBLE_EQ(sigma[3], 12.8);
}

TEST(SetIntrinsicsPrior, KnowsWhichCoefficientIsWhich) {
  const IntrinsicsPrior prior;
  const IntrinsicsVector brown =
      Freed(Description(DistortionModel::kBrownConrady)).intrinsics_sigma;
  EXPECT_EQ(brown[5], prior.radial);
  EXPECT_EQ(brown[6], prior.tangential);
  EXPECT_EQ(brown[7], prior.tangential);
  EXPECT_EQ(brown[8], prior.radial_high);
  const IntrinsicsVector rational = Freed(Description(DistortionModel::kRational)).intrinsics_sigma;
  EXPECT_EQ(rational[7], prior.tangential);
  EXPECT_EQ(rational[11], prior.radial_high);
  // The fisheye model has no tangential part: k3 and k4 stand there.
  const IntrinsicsVector fisheye = Freed(Description(DistortionModel::kFisheye)).intrinsics_sigma;
  EXPECT_EQ(fisheye[5], prior.radial);
  EXPECT_EQ(fisheye[6], prior.radial_high);
  EXPECT_EQ(fisheye[7], prior.radial_high);
}

TEST(SetIntrinsicsPrior, ZeroDistortionGivenAsNoneIsFreedAsWell) {
  CameraDescription description = Description(DistortionModel::kBrownConrady);
  description.intrinsics->distortion.clear();
  const BundleCamera camera = Freed(description);
  EXPECT_EQ(camera.intrinsics_mean.size(), 9);
  EXPECT_EQ(camera.intrinsics_sigma.size(), 9);
  EXPECT_EQ(camera.intrinsics_mean[8], 0);
}

}  // namespace
}  // namespace rigcal::server::intrinsics_prior_test
