// SPDX-License-Identifier: Apache-2.0
#include "common/board/board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace rigcal::board_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(Board, ReadsAndWritesEveryKind) {
  for (const char* text :
       {"board:checker,9x6,0.03", "board:circles,4x11,0.02", "board:circles-symmetric,9x7,0.0125",
        "board:circles,4x11,0.02,0.012", "board:charuco,8x6,0.03,0.022,5x5_100",
        "board:aprilgrid,6x6,0.088,0.3", "board:charuco,10x7,0.025,0.018,5x5_100,two-sided=0.004",
        "board:aprilgrid,5x4,0.04,0.3,two-sided=0.0125"}) {
    const absl::StatusOr<Board> board = ParseBoard(text);
    ASSERT_THAT(board.status(), IsOk());
    EXPECT_EQ(FormatBoard(*board), text);
  }
  const Board board = *ParseBoard("board:circles,4x11,0.02");
  EXPECT_EQ(board.kind, BoardKind::kCircles);
  EXPECT_EQ(board.columns, 4);
  EXPECT_EQ(board.rows, 11);
  EXPECT_EQ(board.spacing_m, 0.02);
}

TEST(Board, PlacesPointsAsOpenCvDoes) {
  const Board checker = *ParseBoard("board:checker,4x3,0.5");
  const auto corners = checker.Points();
  ASSERT_EQ(corners.size(), 12u);
  EXPECT_EQ(corners[5], Eigen::Vector3d(0.5, 0.5, 0));
  const Board circles = *ParseBoard("board:circles,4x11,0.5");
  const auto centres = circles.Points();
  ASSERT_EQ(centres.size(), 44u);
  EXPECT_EQ(centres[1], Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(centres[4], Eigen::Vector3d(0.5, 0.5, 0));
  EXPECT_EQ(centres[8], Eigen::Vector3d(0, 1, 0));
}

TEST(Board, PlacesCornersOfTagsAsKalibrDoes) {
  const Board grid = *ParseBoard("board:aprilgrid,6x5,0.1,0.5");
  EXPECT_EQ(grid.point_count(), 4 * 30);
  const auto corners = grid.Points();
  EXPECT_EQ(corners[0], Eigen::Vector3d(0, 0, 0));
  EXPECT_TRUE(corners[1].isApprox(Eigen::Vector3d(0.1, 0, 0)));
  EXPECT_TRUE(corners[2].isApprox(Eigen::Vector3d(0.15, 0, 0)));
  EXPECT_TRUE(corners[12].isApprox(Eigen::Vector3d(0, 0.1, 0)));
  EXPECT_TRUE(corners[24].isApprox(Eigen::Vector3d(0, 0.15, 0)));
  const Board charuco = *ParseBoard("board:charuco,8x6,0.03,0.022,5x5_100");
  EXPECT_EQ(charuco.columns, 7);
  EXPECT_EQ(charuco.rows, 5);
  EXPECT_FALSE(charuco.HasTwin());
  EXPECT_FALSE(grid.HasTwin());
}

TEST(Board, KnowsItsTwin) {
  EXPECT_FALSE(ParseBoard("board:checker,9x6,0.03")->HasTwin());
  EXPECT_TRUE(ParseBoard("board:checker,8x6,0.03")->HasTwin());
  EXPECT_TRUE(ParseBoard("board:checker,9x7,0.03")->HasTwin());
  EXPECT_FALSE(ParseBoard("board:circles,4x11,0.03")->HasTwin());
  EXPECT_TRUE(ParseBoard("board:circles-symmetric,4x11,0.03")->HasTwin());
}

// As Board says: upright from behind, its columns from right to left, its rows as the front's.
TEST(Board, TheBackIsBehindTheFrontTurnedAboutTheVertical) {
  for (const char* text : {"board:charuco,10x7,0.025,0.018,5x5_100,two-sided=0.004",
                           "board:aprilgrid,5x4,0.04,0.3,two-sided=0.004"}) {
    const Board board = *ParseBoard(text);
    const auto points = board.Points();
    const auto front = board.OneSide().Points();
    const size_t count = front.size();
    ASSERT_EQ(points.size(), 2 * count);
    EXPECT_EQ(board.point_count(), static_cast<int>(2 * count));
    const double depth_m = board.kind == BoardKind::kAprilGrid ? -0.004 : 0.004;
    const Eigen::Vector3d behind(0.1, 0.1, 100 * depth_m), before(0.1, 0.1, -100 * depth_m);
    EXPECT_EQ(board.SideSeenFrom(before), BoardSide::kFront);
    EXPECT_EQ(board.SideSeenFrom(behind), BoardSide::kBack);
    EXPECT_EQ(board.OneSide().SideSeenFrom(behind), BoardSide::kFront);
    for (size_t i = 0; i < count; ++i) {
      const size_t columns = static_cast<size_t>(board.columns), column = i % columns;
      EXPECT_EQ(points[i], front[i]);
      EXPECT_EQ(board.SideOf(i), BoardSide::kFront);
      EXPECT_EQ(board.SideOf(count + i), BoardSide::kBack);
      const Eigen::Vector3d& opposite = front[i - column + (columns - 1 - column)];
      const Eigen::Vector3d shift = points[count + i] - opposite;
      EXPECT_LT((shift - Eigen::Vector3d(0, 0, depth_m)).norm(), 1e-12) << text << " " << i;
      EXPECT_LT((board.FrontFromBack() * front[i] - points[count + i]).norm(), 1e-12);
    }
  }
}

TEST(Board, CountsTheMarkersOfBothSides) {
  EXPECT_EQ(ParseBoard("board:charuco,10x7,0.025,0.018,5x5_100")->side_marker_count(), 35);
  EXPECT_EQ(ParseBoard("board:charuco,7x5,0.025,0.018,5x5_100")->side_marker_count(), 17);
  EXPECT_EQ(ParseBoard("board:aprilgrid,5x4,0.04,0.3,two-sided=0.004")->side_marker_count(), 20);
  EXPECT_EQ(ParseBoard("board:checker,9x6,0.03")->side_marker_count(), 0);
  EXPECT_THAT(ParseBoard("board:charuco,10x7,0.025,0.018,5x5_50"), IsOk());
  EXPECT_THAT(ParseBoard("board:charuco,10x7,0.025,0.018,5x5_50,two-sided=0.004"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("70 markers on both sides, and the dictionary 5x5_50 has 50")));
}

TEST(Board, RefusesSidesThatAreNone) {
  const auto fault = [](const std::string& sides,
                        const char* board = "board:charuco,10x7,0.025,0.018,5x5_100") {
    return std::string(ParseBoard(board + ("," + sides)).status().message());
  };
  EXPECT_THAT(fault("two-sided=4"), HasSubstr("4 m apart? It is given in metres: 4 mm are 0.004"));
  EXPECT_THAT(fault("two-sided=0"), HasSubstr("0 m apart; leave two-sided= out"));
  EXPECT_THAT(fault("two-sided=-0.004"), HasSubstr("the distance of the two sides is -0.004 m"));
  EXPECT_THAT(fault("two-sided=0.0001"), HasSubstr("the distance of the two sides is 0.0001 m"));
  EXPECT_THAT(fault("two-sided=nan"), HasSubstr("\"nan\" is no number of metres"));
  EXPECT_THAT(fault("two-sided="), HasSubstr("\"\" is no number of metres"));
  EXPECT_THAT(fault("two-sided"), HasSubstr("6 parts"));
  EXPECT_THAT(fault("two-sided=0.004,two-sided=0.004"), HasSubstr("6 parts"));
  for (const char* plain :
       {"board:checker,9x6,0.03", "board:circles,4x11,0.02", "board:circles,4x11,0.02,0.012"}) {
    EXPECT_THAT(fault("two-sided=0.004", plain),
                AllOf(HasSubstr("cannot be told apart"), HasSubstr("take a ChArUco board")));
  }
}

TEST(Board, QuotesWhatIsWrong) {
  const auto fault = [](const char* text) {
    return std::string(ParseBoard(text).status().message());
  };
  EXPECT_THAT(ParseBoard("checker,9x6,0.03"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("board:checker,9x6,0.03 ")));
  EXPECT_THAT(fault("checker,9x6,0.03"), HasSubstr("begins with board:"));
  EXPECT_THAT(fault("board:chess,9x6,0.03"), HasSubstr("no kind \"chess\""));
  EXPECT_THAT(fault("board:checker,9x6"), HasSubstr("2 parts"));
  EXPECT_THAT(fault("board:checker,9,0.03"), HasSubstr("\"9\" is not COLUMNSxROWS"));
  EXPECT_THAT(fault("board:checker,9x6,wide"), HasSubstr("\"wide\" is no number"));
  EXPECT_THAT(fault("board:checker,9x6,nan"), HasSubstr("no number"));
  EXPECT_THAT(fault("board:checker,9x6,30"), HasSubstr("30 m? It is given in metres: 30 mm are "
                                                       "0.03"));
  EXPECT_THAT(fault("board:checker,2x600,0.03"),
              AllOf(HasSubstr("columns is 2"), HasSubstr("rows is 600")));
  EXPECT_THAT(fault("board:checker,9x6,0.03m"), HasSubstr("inner corners, not squares"));
  EXPECT_THAT(fault("board:checker,9x6,-0.03"), HasSubstr("spacing is -0.03 m"));
}

}  // namespace
}  // namespace rigcal::board_test
