// SPDX-License-Identifier: Apache-2.0
#include "client/output/quantities.h"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

namespace rigcal::client::quantities_test {
namespace {

TEST(FormatFixed, NeverWritesANegativeZero) {
  EXPECT_EQ(FormatFixed(-0.0004, 3), "0.000");
  EXPECT_EQ(FormatFixed(-0.0006, 3), "-0.001");
  EXPECT_EQ(FormatFixed(-0.0, 1), "0.0");
  EXPECT_EQ(FormatFixed(-10, 0), "-10");
}

TEST(FormatFixed, SaysWhatIsNoNumber) {
  EXPECT_EQ(FormatFixed(std::numeric_limits<double>::quiet_NaN(), 3), "nan");
  EXPECT_EQ(FormatFixed(-std::numeric_limits<double>::infinity(), 3), "-inf");
}

TEST(FormatDuration, ChangesUnitAtAMinute) {
  EXPECT_EQ(FormatDuration(0.816), "0.82 s");
  EXPECT_EQ(FormatDuration(200.4), "3 min 20 s");
  EXPECT_EQ(FormatDuration(std::numeric_limits<double>::quiet_NaN()), "nan s");
  EXPECT_EQ(FormatDuration(1e300), "1e+300 s");
}

TEST(FormatBytes, PicksAUnit) {
  EXPECT_EQ(FormatBytes(12 << 10), "12 KiB");
  EXPECT_EQ(FormatBytes(1536 << 10), "1.5 MiB");
  EXPECT_EQ(FormatBytes(uint64_t{3} << 30), "3.0 GiB");
}

TEST(FormatTime, SaysWhatIsNotSet) { EXPECT_EQ(FormatTime(false, {}), "-"); }

Eigen::Quaterniond About(const Eigen::Vector3d& axis, double angle_rad) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis));
}

TEST(RotationAngleRad, IsExactForSmallAnglesAndBothSigns) {
  for (const double angle_rad : {1e-12, 1e-6, 0.3, 2.0, std::numbers::pi}) {
    const Eigen::Quaterniond rotation = About(Eigen::Vector3d::UnitZ(), angle_rad);
    EXPECT_NEAR(RotationAngleRad(rotation), angle_rad, 1e-12 * angle_rad);
    EXPECT_NEAR(RotationAngleRad(Eigen::Quaterniond(-rotation.coeffs())), angle_rad,
                1e-12 * angle_rad);
  }
}

TEST(RotationVectorRad, IsAxisTimesAngle) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 2) / 3;
  EXPECT_LT((RotationVectorRad(About(axis, 0.9)) - 0.9 * axis).norm(), 1e-12);
  // The same rotation the other way round.
  EXPECT_LT((RotationVectorRad(About(axis, 2 * std::numbers::pi - 0.5)) + 0.5 * axis).norm(),
            1e-12);
  EXPECT_EQ(RotationVectorRad(Eigen::Quaterniond::Identity()), Eigen::Vector3d::Zero());
}

}  // namespace
}  // namespace rigcal::client::quantities_test
