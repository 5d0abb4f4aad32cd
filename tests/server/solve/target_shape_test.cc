// SPDX-License-Identifier: Apache-2.0
// Boards and other rigid targets that are not as they were given.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "common/board/board.h"
#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::target_shape_test {
namespace {

using ::rigcal::testing::IsOk;
using ::testing::HasSubstr;


constexpr char kSimulation[] = "cameras=3;duration=8;rate=5;outliers=0;seed=4";

Target BoardOf(const std::string& text) { return *ParseTarget(text); }

// Its points under other texts are not those of a board.
Target WithoutText(Target board) {
  board.board.clear();
  return board;
}

// What the solver makes of a world with the target `real` if it is told `told`.
CalibrationResult Solve(const Target& real, const Target& told, PoseErrors* errors = nullptr) {
  const SimulatedWorld world = WorldOf(kSimulation, real);
  CalibrationInput input = InputOf(world);
  input.target = told;
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = Estimate::kFixed;
  const CalibrationOutcome outcome = Calibrate(std::move(input), options);
  EXPECT_THAT(outcome.result, IsOk());
  if (errors) *errors = ComparePoses(*outcome.result, world);
  return *outcome.result;
}

const Finding* Shape(const CalibrationResult& result) {
  const auto found =
      std::ranges::find(result.findings, FindingKind::kWrongTargetShape, &Finding::kind);
  return found == result.findings.end() ? nullptr : &*found;
}

TEST(TargetShape, ABoardAsGivenHasNoFinding) {
  for (const char* text : {"board:aprilgrid,4x3,0.06,0.3", "board:checker,9x6,0.04;flatness=0"}) {
    EXPECT_EQ(Shape(Solve(BoardOf(text), BoardOf(text))), nullptr) << text;
  }
}

TEST(TargetShape, TheGapOfAnAprilGridIsNamed) {
  PoseErrors errors;
  const CalibrationResult result = Solve(BoardOf("board:aprilgrid,4x3,0.06,0.36"),
                                         BoardOf("board:aprilgrid,4x3,0.06,0.3"), &errors);
  const Finding* const finding = Shape(result);
  ASSERT_NE(finding, nullptr);
  EXPECT_THAT(finding->advice, HasSubstr("--target board:aprilgrid,4x3,0.06,0.36;"));
  EXPECT_THAT(finding->advice, HasSubstr("is off by"));
  EXPECT_GT(errors.worst_position_m, 0.02);  // this is why it matters
  EXPECT_THAT(result.quality.grade, QualityGrade::kBad);
}

TEST(TargetShape, AStretchedPrintIsNamed) {
  const Target told = BoardOf("board:checker,9x6,0.04");
  Target real = WithoutText(told);
  for (TargetPoint& point : real.points) point.y_m *= 1.04;
  for (const char* flatness : {"", ";flatness=0"}) {
    const CalibrationResult result =
        Solve(real, BoardOf(std::string("board:checker,9x6,0.04") + flatness));
    const Finding* const finding = Shape(result);
    ASSERT_NE(finding, nullptr) << flatness;
    EXPECT_THAT(finding->advice, HasSubstr("further apart than its columns"));
    EXPECT_NE(finding->severity, FindingSeverity::kInfo);
  }
}

TEST(TargetShape, ABentBoardIsNamedAndItsBendEstimated) {
  const Target told = BoardOf("board:checker,9x6,0.04");
  Target real = WithoutText(told);
  for (TargetPoint& point : real.points) {
    point.z_m = 0.004 * std::pow((point.x_m - 0.16) / 0.16, 2);
  }
  PoseErrors errors;
  const CalibrationResult result = Solve(real, told, &errors);
  const Finding* const finding = Shape(result);
  ASSERT_NE(finding, nullptr);
  EXPECT_THAT(finding->advice, HasSubstr("bent by"));
  EXPECT_LT(errors.worst_position_m, 0.01);
}

TEST(TargetShape, OnePointOfABodyIsNamed) {
  Target told = BodyTarget(0.0005);
  Target real = told;
  real.points[5].x_m += 0.008;
  const CalibrationResult result = Solve(real, told);
  const Finding* const finding = Shape(result);
  ASSERT_NE(finding, nullptr);
  EXPECT_THAT(finding->advice, HasSubstr(told.points[5].label + " is off by"));
}

}  // namespace
}  // namespace rigcal::server::target_shape_test
