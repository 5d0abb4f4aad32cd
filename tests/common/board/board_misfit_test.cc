// SPDX-License-Identifier: Apache-2.0
#include "common/board/board_misfit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

namespace rigcal::board_misfit_test {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// In a frame of their own, with a little noise, as a solver finds them.
Points Found(Points points, double scale, double noise_m = 0.00005) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, noise_m);
  const Eigen::AngleAxisd turn(1.2, Eigen::Vector3d(0.3, -0.5, 0.8).normalized());
  for (Eigen::Vector3d& point : points) {
    point = scale * (turn * point) + Eigen::Vector3d(0.4, -2, 1.5) +
            Eigen::Vector3d(normal(random), normal(random), normal(random));
  }
  return points;
}

TEST(ShapeMisfit, HasTheOnePointThatIsOff) {
  const Points given = ParseBoard("board:checker,9x6,0.03")->Points();
  Points moved = given;
  moved[13].y() += 0.01;
  const ShapeMisfit misfit = CompareShapes(given, Found(moved, 1));
  EXPECT_EQ(misfit.worst, 13u);
  EXPECT_NEAR(misfit.worst_m, 0.01, 0.001);
  EXPECT_LT(CompareShapes(given, Found(given, 1)).rms_m, 0.0002);
}

TEST(BoardMisfit, TellsTwoSidesThatAreFurtherApartOrShifted) {
  for (const char* text : {"board:charuco,10x7,0.025,0.018,5x5_100,two-sided=0.004",
                           "board:aprilgrid,4x4,0.04,0.3,two-sided=0.004"}) {
    const Board told = *ParseBoard(text);
    for (const double thickness_m : {0.0025, 0.006, 0.01}) {
      Board print = told;
      print.thickness_m = thickness_m;
      const Points found = Found(print.Points(), 0.98);
      EXPECT_NEAR(BackOffset(told, found).head<2>().norm(), 0, 0.0001);
      const BoardMisfit misfit = ExplainBoardMisfit(told, found);
      EXPECT_EQ(misfit.cause, MisfitCause::kThickness) << text << " " << thickness_m;
      EXPECT_NEAR(misfit.found, thickness_m, 0.0002);
      EXPECT_NEAR(misfit.scale, 0.98, 0.001);
    }
    Points shifted = told.Points();
    for (size_t i = shifted.size() / 2; i < shifted.size(); ++i) shifted[i].x() -= 0.003;
    const BoardMisfit misfit = ExplainBoardMisfit(told, Found(shifted, 1));
    EXPECT_EQ(misfit.cause, MisfitCause::kShift);
    EXPECT_NEAR(misfit.found, 0.003, 0.0001);
    EXPECT_NEAR(BackOffset(told, Found(shifted, 1)).x(), -0.003, 0.0001);
    // A bend is one of both sides together.
    Points bent = told.Points();
    for (Eigen::Vector3d& point : bent) point.z() += 0.003 * std::pow((point.x() - 0.1) / 0.1, 2);
    EXPECT_EQ(ExplainBoardMisfit(told, Found(bent, 1)).cause, MisfitCause::kBend);
  }
}

TEST(BoardMisfit, TellsTheGapOfAnAprilGrid) {
  const Board told = *ParseBoard("board:aprilgrid,6x6,0.088,0.3");
  for (const double gap : {0.2, 0.27, 0.35, 0.5}) {
    Board print = told;
    print.gap_share = gap;
    // The solver keeps the size of the board as it was told, in the mean.
    const BoardMisfit misfit = ExplainBoardMisfit(told, Found(print.Points(), 0.96));
    EXPECT_EQ(misfit.cause, MisfitCause::kGap) << gap;
    EXPECT_NEAR(misfit.found, gap, 0.001);
    EXPECT_NEAR(misfit.scale, 0.96, 0.001);
  }
}

TEST(BoardMisfit, TellsAStretchedPrint) {
  for (const char* text : {"board:checker,9x6,0.03", "board:charuco,10x7,0.03,0.022,5x5_100",
                           "board:circles,4x11,0.02", "board:aprilgrid,6x6,0.088,0.3"}) {
    const Board told = *ParseBoard(text);
    Points print = told.Points();
    for (Eigen::Vector3d& point : print) point.y() *= 1.03;
    const BoardMisfit misfit = ExplainBoardMisfit(told, Found(print, 1));
    EXPECT_EQ(misfit.cause, MisfitCause::kStretch) << text;
    EXPECT_NEAR(misfit.found, 1.03, 0.001);
    EXPECT_NEAR(misfit.scale, 1, 0.001);
  }
}

TEST(BoardMisfit, TellsABend) {
  const Board told = *ParseBoard("board:checker,9x6,0.03");
  Points print = told.Points();
  for (Eigen::Vector3d& point : print) point.z() = 0.002 * std::pow((point.x() - 0.12) / 0.12, 2);
  const BoardMisfit misfit = ExplainBoardMisfit(told, Found(print, 1));
  EXPECT_EQ(misfit.cause, MisfitCause::kBend);
  EXPECT_NEAR(misfit.found, 0.002, 0.0003);
}

TEST(BoardMisfit, DoesNotKnowWhatNoneOfThemExplains) {
  const Board told = *ParseBoard("board:checker,9x6,0.03");
  EXPECT_EQ(ExplainBoardMisfit(told, Found(told.Points(), 1, 0.003)).cause, MisfitCause::kUnknown);
}

}  // namespace
}  // namespace rigcal::board_misfit_test
