// SPDX-License-Identifier: Apache-2.0
#include "common/scale/unit_ratio.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/scale/solve_scale.h"

namespace rigcal {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(UnitOfRatio, NamesTheUnitThatFits) {
  EXPECT_EQ(UnitOfRatio(1012, 0.05), "millimetres");
  EXPECT_EQ(UnitOfRatio(97, 0.05), "centimetres");
  EXPECT_EQ(UnitOfRatio(39.4, 0.05), "inches");
  EXPECT_EQ(UnitOfRatio(3.3, 0.05), "feet");
  EXPECT_EQ(UnitOfRatio(1100, 0.05), "");
  EXPECT_EQ(UnitOfRatio(1.01, 0.05), "");
}

TEST(DescribeRatio, SaysPercentOfSmallRatiosOnly) {
  EXPECT_EQ(DescribeRatio(1.03), "3.000 % longer");
  EXPECT_EQ(DescribeRatio(0.75), "25.000 % shorter");
  EXPECT_EQ(DescribeRatio(2.5), "2.50 times as long");
  EXPECT_EQ(DescribeRatio(1000), "1000 times as long");
  EXPECT_EQ(DescribeRatio(0.001), "1/1000 as long");
}

// "690.8 % shorter" was the logarithm of 1000.
TEST(DisagreementOf, NamesTheUnitOfALengthInMillimetres) {
  const ScaleSource wand{"the target", 1, 0.002, 1, 0, {}};
  const ScaleSource distance{"distance a to b", 2500, 2, 2.5, 0, {}};
  const std::string of_two = DisagreementOf(FuseScales({wand, distance}, {}));
  EXPECT_THAT(of_two, AllOf(HasSubstr("\"the target\" is 1/1000 as long as the others"),
                            HasSubstr("is \"distance a to b\" in millimetres? Give metres"),
                            Not(HasSubstr("%"))));
  ScaleSource again = wand;
  again.name = "length 0 to 2";
  const std::string of_three = DisagreementOf(FuseScales({wand, distance, again}, {}));
  EXPECT_THAT(of_three, AllOf(HasSubstr("1000 times as long as"), HasSubstr("in millimetres?"),
                              HasSubstr("--leave-out")));
  ScaleSource off = again;
  off.given_m = 1.03;
  EXPECT_THAT(DisagreementOf(FuseScales({wand, off, again}, {})),
              AllOf(HasSubstr("is 3.000 % longer than the others"), Not(HasSubstr("Give metres"))));
}

}  // namespace
}  // namespace rigcal
