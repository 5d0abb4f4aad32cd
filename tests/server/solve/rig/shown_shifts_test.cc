// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/shown_shifts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::server::shown_shifts_test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;

// A pose that takes the mean of three: of its own shift a row shows 2/3, of another's 1/3.
TEST(OwnVariances, AreThoseThatTheResidualsShowAPartOf) {
  Eigen::MatrixXd shares = Eigen::MatrixXd::Constant(3, 3, 1.0 / 9);
  shares.diagonal().setConstant(4.0 / 9);
  EXPECT_THAT(OwnVariances(shares, {4.0 / 9 * 64, 64.0 / 9, 64.0 / 9}),
              ElementsAre(DoubleNear(64, 1), DoubleNear(0, 1), DoubleNear(0, 1)));
}

TEST(OwnVariances, OfCamerasThatCannotBeToldApartAreAlike) {
  EXPECT_THAT(OwnVariances(Eigen::MatrixXd::Constant(2, 2, 0.25), {8, 8}),
              ElementsAre(DoubleNear(16, 0.2), DoubleNear(16, 0.2)));
}

TEST(OwnVariances, WithoutSharesAreWhatIsShown) {
  EXPECT_THAT(OwnVariances(Eigen::MatrixXd::Zero(1, 1), {3}), ElementsAre(3));
  EXPECT_EQ(ShownShares({}).size(), 0);
}

}  // namespace
}  // namespace rigcal::server::shown_shifts_test
