// SPDX-License-Identifier: Apache-2.0
#include "common/target/target.h"

#include <limits>
#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::target_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(ParseTarget, ReadsAWand) {
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("wand:0,0.13,0.39"));
  EXPECT_EQ(target.kind, TargetKind::kWand);
  EXPECT_THAT(target.marker_positions_m, ElementsAre(0, 0.13, 0.39));
  EXPECT_EQ(target.span_tolerance_m, 0.002);
  EXPECT_EQ(target.diameter_m, 0);
  EXPECT_TRUE(target.blink_hz.empty());
}

TEST(ParseTarget, ReadsEveryOption) {
  ASSERT_OK_AND_ASSIGN(
      const Target target,
      ParseTarget(" wand:0, 0.13 ,0.39 ; diameter=0.04;hz=500,600,700;tolerance=0.001 "));
  EXPECT_EQ(target.diameter_m, 0.04);
  EXPECT_THAT(target.blink_hz, ElementsAre(500, 600, 700));
  EXPECT_EQ(target.span_tolerance_m, 0.001);
}

TEST(ParseTarget, BeginsAtZero) {
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("wand:-0.25,0.25,0.75;hz=3,1,2"));
  EXPECT_THAT(target.marker_positions_m, ElementsAre(0, 0.5, 1));
  EXPECT_THAT(target.blink_hz, ElementsAre(3, 1, 2));
}

// Rows name markers by their order.
TEST(ParseTarget, RefusesAnotherOrderAndNamesBothWands) {
  EXPECT_THAT(ParseTarget("wand:0.39,0.13,0"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("mean wand:0,0.13,0.39"), HasSubstr("wand:0,0.26,0.39?"))));
  EXPECT_THAT(ParseTarget("wand:0,0.39,0.13"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("mean wand:0,0.13,0.39?")));
}

TEST(ParseTarget, RefusesCentimetres) {
  EXPECT_THAT(ParseTarget("wand:0,5,15"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("15 m long"), HasSubstr("wand:0,0.05,0.15"))));
  EXPECT_THAT(ParseTarget("wand:0,1,4"), IsOk());
}

TEST(ParseTarget, ReadsAPoint) {
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("point;diameter=0.04"));
  EXPECT_EQ(target.kind, TargetKind::kPoint);
  EXPECT_THAT(target.marker_positions_m, ElementsAre(0));
  EXPECT_EQ(target.diameter_m, 0.04);
}

TEST(ParseTarget, ReadsABoard) {
  const auto target = ParseTarget("board:checker,9x6,0.03");
  ASSERT_THAT(target, IsOk());
  EXPECT_EQ(target->kind, TargetKind::kRigid);
  EXPECT_EQ(target->board, "board:checker,9x6,0.03");
  ASSERT_EQ(target->marker_count(), 54);
  EXPECT_EQ(target->points[10].label, "c1r1");
  EXPECT_EQ(target->points[10].x_m, 0.03);
  EXPECT_EQ(target->points[10].y_m, 0.03);
  EXPECT_EQ(target->points[53].sigma_m, kBoardSigmaM);
  EXPECT_THAT(CheckDetectable(*target), IsOk());
  EXPECT_FALSE(CheckIsLine(*target).ok());
  EXPECT_EQ(FormatTarget(*target), "board:checker,9x6,0.03");
  const std::string two_sided = "board:charuco,10x7,0.025,0.018,5x5_100,two-sided=0.004";
  const auto both = ParseTarget(two_sided + ";flatness=0.002");
  ASSERT_THAT(both, IsOk());
  ASSERT_EQ(both->points.size(), 108u);
  EXPECT_EQ(both->points[1].label, "c1r0");
  EXPECT_EQ(both->points[55].label, "back-c1r0");
  EXPECT_EQ(both->points[55].z_m, 0.004);
  EXPECT_EQ(FormatTarget(*both), two_sided + ";flatness=0.002");
  const auto exact = ParseTarget("board:circles,4x11,0.020;flatness=0");
  ASSERT_THAT(exact, IsOk());
  EXPECT_EQ(exact->points[0].sigma_m, 0);
  EXPECT_EQ(FormatTarget(*exact), "board:circles,4x11,0.02;flatness=0");
  EXPECT_EQ(*ParseTarget(FormatTarget(*exact)), *exact);
}

TEST(ParseTarget, RefusesBoardsThatNobodyCanUse) {
  const auto message = [](std::string_view text) {
    return std::string(ParseTarget(text).status().message());
  };
  EXPECT_THAT(message("board:checker,8x6,0.03"), HasSubstr("turned by 180 degrees"));
  EXPECT_THAT(message("board:circles-symmetric,9x6,0.03"), HasSubstr("turned by 180 degrees"));
  EXPECT_THAT(message("board:checker,20x11,0.03"), HasSubstr("at most 200"));
  EXPECT_THAT(message("board:checker,9x6,30"), HasSubstr("metres"));
  EXPECT_THAT(message("board:aprilgrid,6x6,0.088,0.3,two-sided=0.004"),
              HasSubstr("288 points on both sides, a target has at most 200: take one with fewer"));
  EXPECT_THAT(message("board:checker,9x6"), HasSubstr("board:checker,9x6,0.03"));
  EXPECT_THAT(message("board:checker,9x6,0.03;flatness=flat"), HasSubstr("flatness"));
  EXPECT_THAT(message("board:checker,9x6,0.03;flatness=-1"), HasSubstr("the flatness is -1 m"));
  EXPECT_THAT(message("board:checker,9x6,0.03;flatness=nan"), HasSubstr("the flatness is nan"));
  EXPECT_THAT(message("board:checker,9x6,0.03;diameter=0.04"), HasSubstr("no option of a board"));
}

TEST(Target, PointsOfABoardAreItsOwn) {
  Target target = *ParseTarget("board:checker,9x6,0.03");
  EXPECT_THAT(target.Validate(), IsOk());
  target.points[3].x_m += 0.001;
  EXPECT_THAT(std::string(target.Validate().message()), HasSubstr("not those of board:checker"));
  target = *ParseTarget("board:checker,9x6,0.03");
  target.board = "board:checker,9x7,0.03";
  EXPECT_FALSE(target.Validate().ok());
  target = *ParseTarget("wand:0,0.13,0.39");
  target.board = "board:checker,9x6,0.03";
  EXPECT_FALSE(target.Validate().ok());
}

TEST(ParseTarget, RefusesAWandWithoutTwoDistinctPositions) {
  for (const char* text : {"wand:", "wand:0", "wand:0.13", "wand:0,0", "wand:0.13,0.13,0.13"}) {
    EXPECT_THAT(ParseTarget(text),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("wand:0,0.13,0.39")))
        << text;
  }
  EXPECT_THAT(ParseTarget("wand:0.13,0.13"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("two distinct positions")));
  EXPECT_THAT(ParseTarget("wand:0"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("two distinct")));
}

TEST(ParseTarget, RefusesAPositionGivenTwice) {
  EXPECT_THAT(ParseTarget("wand:0,0,0.13"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("same position")));
  EXPECT_THAT(ParseTarget("wand:0,0.13,0.13000001"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("same position")));
}

TEST(ParseTarget, QuotesWhatIsWrongAndShowsARightExample) {
  const struct {
    const char* text;
    const char* quoted;
  } cases[] = {
      {"", "is not a target"},
      {"stick:0,1", "stick"},
      {"Wand:0,0.1", "Wand"},
      {"wand:0,abc,0.4", "\"abc\""},
      {"wand:0,,0.4", "\"\""},
      {"wand:0,0.13,", "\"\""},
      {"wand:0,nan", "\"nan\""},
      {"wand:0,inf", "\"inf\""},
      {"wand:0,1e999", "\"1e999\""},
      {"wand:0,0.13 0.39", "0.13 0.39"},
      {"wand:0,0.13;colour=red", "unknown option \"colour\"; known: diameter, hz, tolerance"},
      {"wand:0,0.13;tolerence=1", "did you mean \"tolerance\"?"},
      {"wand:0,0.13;", "\"\" is not KEY=VALUE"},
      {"wand:0,0.13;tolerance", "tolerance"},
      {"wand:0,0.13;tolerance=-0.001", "tolerance"},
      {"wand:0,0.13;tolerance=0", "tolerance"},
      {"wand:0,0.13;tolerance=nan", "nan"},
      {"wand:0,0.13;tolerance=0.1,0.2", "must be a number above 0"},
      {"wand:0,0.13;diameter=-1", "diameter"},
      {"wand:0,0.13;hz=0", "hz"},
      {"wand:0,0.13;hz=-5", "hz"},
      {"wand:0,0.13;hz=1,2,3", "3 blink frequencies"},
      {"wand:0,0.13;hz=500;hz=600", "given twice"},
      {"wand:0,130,390", "millimetres, write wand:0,0.13,0.39"},
      {"wand:0,13,39", "metres; if these are centimetres, write wand:0,0.13,0.39"},
      {"wand:0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16", "17 markers"},
      {"wand:0.13,0.39", "mean wand:0,0.13,0.39 (3 markers) or wand:0,0.26 (2 markers)"},
      {"point:1", "point:1"},
      {"point;hz=1,2", "frequencies"},
  };
  for (const auto& c : cases) {
    EXPECT_THAT(ParseTarget(c.text),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr(c.quoted), HasSubstr("wand:0,0.13,0.39"))))
        << c.text;
  }
}

TEST(ParseTarget, AcceptsUpToSixteenMarkers) {
  EXPECT_THAT(ParseTarget("wand:0,.1,.2,.3,.4,.5,.6,.7,.8,.9,1,1.1,1.2,1.3,1.4,1.5"), IsOk());
}

TEST(ParseTarget, RefusesLongAndBinaryTextWithAShortMessage) {
  for (const std::string& text : {std::string(1 << 20, '7'), "wand:" + std::string(3000, 'x'),
                                  std::string("wand:\0\1\2", 8)}) {
    const absl::StatusOr<Target> target = ParseTarget(text);
    ASSERT_FALSE(target.ok());
    EXPECT_LT(target.status().message().size(), 1500u);
    EXPECT_EQ(target.status().message().find('\0'), absl::string_view::npos);
  }
}

TEST(FormatTarget, IsReadBackWithEveryDigit) {
  Target third;
  third.marker_positions_m = {0, 1.0 / 3, 0.1 + 0.7};
  third.diameter_m = 0.1 / 3;
  third.blink_hz = {1e5 / 3};
  third.span_tolerance_m = 1e-5 / 7;
  Target point;
  point.kind = TargetKind::kPoint;
  point.marker_positions_m = {0};
  Target per_marker;
  per_marker.marker_positions_m = {0, 0.2};
  per_marker.blink_hz = {600, 500};
  for (const Target& target : {third, point, per_marker}) {
    ASSERT_OK_AND_ASSIGN(const Target again, ParseTarget(FormatTarget(target)));
    EXPECT_EQ(again, target) << FormatTarget(target);
  }
  ASSERT_OK_AND_ASSIGN(const Target plain, ParseTarget("wand:0,0.13,0.39"));
  EXPECT_EQ(FormatTarget(plain), "wand:0,0.13,0.39");
}

TEST(Target, ListsEveryFault) {
  Target target;
  target.marker_positions_m = {0.1, 0.05, std::numeric_limits<double>::quiet_NaN()};
  target.diameter_m = -1;
  target.span_tolerance_m = std::numeric_limits<double>::infinity();
  EXPECT_THAT(target.Validate(), StatusIs(absl::StatusCode::kInvalidArgument,
                                          AllOf(HasSubstr("must be at 0"),
                                                HasSubstr("must increase"), HasSubstr("not finite"),
                                                HasSubstr("diameter"), HasSubstr("tolerance"))));
  EXPECT_FALSE(Target{}.Validate().ok()) << "no markers";
}

}  // namespace
}  // namespace rigcal::target_test
