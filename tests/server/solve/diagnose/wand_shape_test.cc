// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/wand_shape.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <random>
#include <vector>

namespace rigcal::server::wand_shape_test {
namespace {

constexpr size_t kShapes = 400;

// Wands that point everywhere, straight but for a noise of 0.5 mm.
std::vector<WandShape> StraightWands() {
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, 1);
  std::vector<WandShape> shapes(kShapes);
  for (size_t i = 0; i < kShapes; ++i) {
    WandShape& shape = shapes[i];
    shape.instant = i;
    shape.time_ns = static_cast<int64_t>(i) * 100'000'000;
    shape.axis = Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    const Eigen::Vector3d noise_m =
        5e-4 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    shape.off_line_m = noise_m - shape.axis.dot(noise_m) * shape.axis;
    shape.span_m[0] = 5e-4 * normal(random);
    shape.span_m[1] = 5e-4 * normal(random);
  }
  return shapes;
}

TEST(WandShapeTest, SagIsFoundWithItsDirection) {
  std::vector<WandShape> shapes = StraightWands();
  const Eigen::Vector3d sag_m(0.001, 0.005, -0.002);
  for (WandShape& shape : shapes) {
    shape.off_line_m += sag_m - shape.axis.dot(sag_m) * shape.axis;
  }
  const WandFault fault = SagOf(shapes);
  EXPECT_LT((fault.sag_m - sag_m).norm(), 2e-4);
  EXPECT_LT(fault.sigma_m, 1e-4);
  const WandFault none = SagOf(StraightWands());
  EXPECT_LT(none.size_m, 4 * none.sigma_m);
}

TEST(WandShapeTest, TheMarkerThatSlippedIsFound) {
  for (int place = 0; place < 3; ++place) {
    std::vector<WandShape> shapes = StraightWands();
    constexpr size_t kFrom = 137;
    constexpr double kSlipM = -0.004;
    for (size_t i = kFrom; i < kShapes; ++i) {
      if (place > 0) shapes[i].span_m[place - 1] += kSlipM;
      if (place < 2) shapes[i].span_m[place] -= kSlipM;
    }
    const auto fault = SlipOf(shapes);
    ASSERT_TRUE(fault.has_value());
    EXPECT_EQ(fault->place, place);
    EXPECT_NEAR(fault->size_m, kSlipM, 2e-4);
    EXPECT_NEAR(1e-9 * static_cast<double>(fault->time_ns), 13.7, 0.5);
  }
}

TEST(WandShapeTest, WithoutASlipItIsWithinItsSigma) {
  const auto fault = SlipOf(StraightWands());
  ASSERT_TRUE(fault.has_value());
  EXPECT_LT(std::abs(fault->size_m), 5 * fault->sigma_m);
}

TEST(WandShapeTest, FewInstantsSayNothing) {
  EXPECT_FALSE(SlipOf({}).has_value());
  EXPECT_FALSE(SlipOf(std::vector<WandShape>(30)).has_value());
  EXPECT_EQ(SagOf({}).size_m, 0);
}

}  // namespace
}  // namespace rigcal::server::wand_shape_test
