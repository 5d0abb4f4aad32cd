// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/clock_reference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::server::clock_reference_test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// The median, 6 ms, would blame all four.
TEST(ReferenceOfClocks, IsTheLargestGroupThatAgrees) {
  const ClockReference reference = ReferenceOfClocks({0.0081, 0.004, -0.003, 0.008}, 1e-3);
  EXPECT_THAT(reference.offset_s, DoubleNear(0.00805, 1e-9));
  EXPECT_THAT(reference.members, ElementsAre(0, 3));
  EXPECT_FALSE(reference.is_either);
}

TEST(ReferenceOfClocks, OfTwoEqualGroupsEitherMayBeOff) {
  const ClockReference reference = ReferenceOfClocks({0.008, 0.0, 0.0002, 0.0079}, 1e-3);
  EXPECT_THAT(reference.members, ElementsAre(0, 3));
  EXPECT_TRUE(reference.is_either);
}

TEST(ReferenceOfClocks, WhereNoTwoAgreeItIsTheMedian) {
  const ClockReference reference = ReferenceOfClocks({-1, 0.5, 3}, 1e-3);
  EXPECT_THAT(reference.members, IsEmpty());
  EXPECT_EQ(reference.offset_s, 0.5);
  EXPECT_FALSE(reference.is_either);
  EXPECT_EQ(ReferenceOfClocks({0.25}, 1e-3).offset_s, 0.25);
}

// 0, 0.8 and 1.6 ms: a chain of neighbours is no group.
TEST(ReferenceOfClocks, AGroupIsNoWiderThanAllowed) {
  const ClockReference reference = ReferenceOfClocks({0, 0.8e-3, 1.6e-3}, 1e-3);
  EXPECT_EQ(reference.members.size(), 2u);
}

}  // namespace
}  // namespace rigcal::server::clock_reference_test
