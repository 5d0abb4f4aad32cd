// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/target_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace rigcal::server::target_parts_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

Target Parsed(const std::string& text) { return *ParseTarget(text); }

const char kBoard[] = "rigid:{a 0 0 0|b 1 0 0|c 0 1 0|d 1 1 0}";
const char kFrame[] = "rigid:{a 0 0 0|b 2 0 0|c 0 2 0|d 0 0 2|e 2 2 2}";

TEST(TargetParts, OneWandIsTheLine) {
  const TargetParts parts(Parsed("wand:0,0.13,0.39"));
  EXPECT_FALSE(parts.is_mixed());
  EXPECT_FALSE(parts.Of("any").is_rigid);
  EXPECT_THAT(parts.lines(), ElementsAre(Parsed("wand:0,0.13,0.39")));
  EXPECT_THAT(parts.points(), IsEmpty());
  EXPECT_TRUE(parts.HasLengths());
}

TEST(TargetParts, PointsAloneAreTheLine) {
  const TargetParts parts(Parsed("point"), {{"big", Parsed("point;diameter=0.1")}});
  EXPECT_FALSE(parts.Of("big").is_rigid);
  EXPECT_EQ(parts.Of("big").target.diameter_m, 0.1);
  EXPECT_FALSE(parts.HasLengths());
}

TEST(TargetParts, RigidTargetsFollowEachOtherAndEqualOnesAreOne) {
  const TargetParts parts(Parsed(kBoard), {{"frame", Parsed(kFrame)},
                                           {"point", Parsed("point")},
                                           {"board2", Parsed(std::string(kBoard) + ";hz=5")},
                                           {"wand", Parsed("wand:0,0.2")}});
  EXPECT_TRUE(parts.is_mixed());
  EXPECT_THAT(parts.points(), SizeIs(10));
  EXPECT_THAT(parts.first_points(), ElementsAre(0, 4, 9));
  EXPECT_EQ(parts.Of("the first").first_marker, 0);
  EXPECT_EQ(parts.Of("board2").first_marker, 0);
  EXPECT_EQ(parts.Of("frame").first_marker, 4);
  EXPECT_TRUE(parts.Of("frame").is_rigid);
  EXPECT_FALSE(parts.Of("frame").is_point);
  EXPECT_EQ(parts.Of("point").first_marker, 9);
  EXPECT_TRUE(parts.Of("point").is_point);
  EXPECT_FALSE(parts.Of("wand").is_rigid);
  EXPECT_THAT(parts.lines(), ElementsAre(Parsed("wand:0,0.2")));
}

TEST(TargetParts, WandsFollowEachOtherAndEqualOnesAreOne) {
  const TargetParts parts(Parsed("wand:0,0.13,0.39"),
                          {{"long", Parsed("wand:0,0.5")},
                           {"rough", Parsed("wand:0,0.5;tolerance=0.004")},
                           {"same", Parsed("wand:0,0.13,0.39;hz=500")}});
  EXPECT_THAT(parts.lines(), SizeIs(3));
  EXPECT_EQ(parts.Of("same").first_marker, 0);
  EXPECT_EQ(parts.Of("long").first_marker, 3);
  EXPECT_EQ(parts.Of("rough").first_marker, 5);
}

TEST(TargetParts, StaticPointsArePointsBesideAWand) {
  const TargetParts parts(Parsed("wand:0,0.13,0.39"), {{"room", Parsed("static:{a|b|c}")}});
  EXPECT_FALSE(parts.Of("").is_rigid);
  EXPECT_TRUE(parts.Of("room").is_point);
  EXPECT_EQ(parts.points().size(), 1u);
  EXPECT_TRUE(parts.HasLengths());
}

TEST(TargetParts, AndASingleMarkerBesideAPoint) {
  const TargetParts parts(Parsed("static:{a|b|c}"), {{"s", Parsed("point")}});
  EXPECT_FALSE(parts.Of("").is_rigid);
  EXPECT_FALSE(parts.HasLengths());
  ASSERT_EQ(parts.lines().size(), 1u);
  EXPECT_THAT(parts.lines()[0].marker_positions_m, ElementsAre(0));
}

TEST(TargetParts, ASurveyIsARigidTarget) {
  const TargetParts parts(Parsed("wand:0,0.13,0.39"),
                          {{"room", Parsed("static:{a 0 0 0|b 1 0 0|c 0 1 0|d 0 0 1}")}});
  EXPECT_TRUE(parts.Of("room").is_rigid);
  EXPECT_FALSE(parts.Of("room").is_point);
  EXPECT_EQ(parts.points().size(), 4u);
}

}  // namespace
}  // namespace rigcal::server::target_parts_test
