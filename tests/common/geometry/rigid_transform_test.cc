// SPDX-License-Identifier: Apache-2.0
#include "common/geometry/rigid_transform.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::rigid_transform_test {
namespace {

const RigidTransform kAFromB(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1, 2, 3});
const RigidTransform kBFromC(
    Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, -2, 0.5).normalized())),
    {-0.3, 0.25, 4});
const Eigen::Vector3d kXInC(0.1, -5, 2);

TEST(RigidTransform, ProductsReadByAdjacency) {
  const Eigen::Vector3d step_by_step = kAFromB * (kBFromC * kXInC);
  EXPECT_LT((kAFromB * kBFromC * kXInC - step_by_step).norm(), 1e-14);
}

TEST(RigidTransform, RotatesThenShifts) {
  const RigidTransform quarter_turn(
      Eigen::Quaterniond(Eigen::AngleAxisd(std::acos(-1.0) / 2, Eigen::Vector3d::UnitZ())),
      {10, 0, 0});
  EXPECT_LT((quarter_turn * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(10, 1, 0)).norm(), 1e-15);
}

TEST(RigidTransform, InverseUndoes) {
  EXPECT_LT((kBFromC.Inverse() * (kBFromC * kXInC) - kXInC).norm(), 1e-14);
  EXPECT_LT(((kBFromC * kBFromC.Inverse()).Matrix() - Eigen::Matrix4d::Identity()).norm(), 1e-14);
}

TEST(RigidTransform, CentreOfTheSourceIsWhereTheInversePutsTheOrigin) {
  EXPECT_LT((kBFromC.SourceFromTargetTranslation() - kBFromC.Inverse().translation_m).norm(),
            1e-15);
  EXPECT_LT((kBFromC * kBFromC.SourceFromTargetTranslation()).norm(), 1e-14);
}

TEST(RigidTransform, MatrixDoesTheSame) {
  const Eigen::Vector4d moved = kAFromB.Matrix() * kXInC.homogeneous();
  EXPECT_LT((moved.head<3>() - kAFromB * kXInC).norm(), 1e-14);
  EXPECT_EQ(moved[3], 1);
}

TEST(RigidTransform, LongProductsStayRotations) {
  RigidTransform product;
  for (int i = 0; i < 100000; ++i) product = product * kBFromC;
  EXPECT_NEAR(product.rotation.norm(), 1, 1e-12);
}

TEST(Canonical, IsTheSameRotationWithPositiveW) {
  const Eigen::Quaterniond negative(-0.5, 0.5, -0.5, 0.5);
  const Eigen::Quaterniond canonical = Canonical(negative);
  EXPECT_EQ(canonical.w(), 0.5);
  EXPECT_LT((canonical.toRotationMatrix() - negative.toRotationMatrix()).norm(), 1e-15);
  EXPECT_EQ(Canonical(canonical).coeffs(), canonical.coeffs());
}

}  // namespace
}  // namespace rigcal::rigid_transform_test
