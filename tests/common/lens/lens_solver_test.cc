// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_solver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "common/lens/lens_difference.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::lens_solver_test {
namespace {

using namespace rigcal::testing;  // the known lens
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kNoisePx = 0.03;

const Board kBoard = *ParseBoard("board:checker,9x6,0.03");

std::vector<BoardView> Views(const Intrinsics& lens, int count, double most_tilt_rad = 0.7,
                             uint32_t seed = 3) {
  const bool wide = lens.model == DistortionModel::kFisheye;
  const auto poses = WavedBoard(kBoard, lens, kKnownImage, count, wide ? 0.15 : 0.3,
                                wide ? 0.35 : 0.6, most_tilt_rad, seed, 0.85);
  return SeenBoards(kBoard, lens, kKnownImage, poses, kNoisePx, seed);
}

// What the noise of these corners leaves is about half of what the halves differ by.
TEST(SolveLens, FindsPinholeAndFisheyeByItself) {
  for (const Intrinsics& lens : {KnownPinhole(), KnownFisheye()}) {
    const auto solved = SolveLens(Views(lens, 36), kKnownImage);
    ASSERT_THAT(solved, IsOk());
    EXPECT_EQ(solved->intrinsics.model, lens.model) << LensModelName(solved->model);
    const auto difference = CompareLenses(lens, solved->intrinsics, kKnownImage);
    ASSERT_THAT(difference, IsOk());
    EXPECT_LT(difference->p95_px, 0.1) << LensModelName(solved->model);
    EXPECT_NEAR(solved->rms_px, kNoisePx * std::sqrt(2.0), 0.01);
    EXPECT_GE(solved->held_out_rms_px, solved->rms_px);
    EXPECT_LT(solved->held_out_rms_px, 1.1 * solved->rms_px);
    ASSERT_TRUE(solved->halves.has_value());
    EXPECT_LT(solved->halves->median_px, 0.15);
    EXPECT_GT(solved->halves->p95_px, difference->p95_px / 3);
    // Within four sigmas.
    EXPECT_LT(std::abs(solved->intrinsics.fx_px - lens.fx_px), 4 * solved->sigmas[0]);
    EXPECT_LT(solved->sigmas[0], 1);
    EXPECT_EQ(solved->candidates.size(), 4u);
  }
}

// As if cardboard had curled: 2 mm higher at the left and right than in the middle.
TEST(SolveLens, EstimatesHowABoardIsBent) {
  const Intrinsics lens = KnownPinhole();
  const auto poses = WavedBoard(kBoard, lens, kKnownImage, 36, 0.3, 0.6, 0.7, 3, 0.85);
  const auto flat = SeenBoards(kBoard, lens, kKnownImage, poses, 0, 3);
  ASSERT_EQ(flat.size(), poses.size());
  double p95_of_flat_px = 0;
  for (const double height_m : {0.0, 0.002, -0.001}) {
    std::mt19937 random(5);  // the same noise
    std::normal_distribution<double> noise(0, kNoisePx);
    std::vector<BoardView> views = flat;
    for (size_t i = 0; i < views.size(); ++i) {
      for (BoardCorner& corner : views[i].corners) {
        Eigen::Vector3d at = corner.x_in_board_m;
        at.z() = height_m * std::pow((at.x() - 0.12) / 0.12, 2);
        ASSERT_TRUE(Project(lens, poses[i] * at, &corner.pixel));
        corner.pixel += Eigen::Vector2d(noise(random), noise(random));
      }
    }
    const auto solved = SolveLens(views, kKnownImage);
    ASSERT_THAT(solved, IsOk());
    EXPECT_NEAR(solved->rms_px, kNoisePx * std::sqrt(2.0), 0.01);
    const auto difference = CompareLenses(lens, solved->intrinsics, kKnownImage);
    ASSERT_THAT(difference, IsOk());
    ASSERT_EQ(solved->bend.has_value(), height_m != 0);
    // A bend is not told apart from the lens for nothing, and the uncertainty says so.
    EXPECT_LT(difference->p95_px, 2.5 * solved->uncertainty.p95_px);
    if (height_m == 0) {
      p95_of_flat_px = solved->uncertainty.p95_px;
      continue;
    }
    EXPECT_GT(solved->uncertainty.p95_px, p95_of_flat_px);
    EXPECT_LT(solved->uncertainty.p95_px, 3 * p95_of_flat_px);
    EXPECT_NEAR(solved->bend->height_m.x(), height_m, 1e-4);
    EXPECT_NEAR(solved->bend->height_m.y(), 0, 1e-4);
    EXPECT_LT(solved->bend->sigma_m.x(), 5e-5);
    EXPECT_THAT(solved->advice, Contains(HasSubstr("the board is bent by")));
  }
}

TEST(SolveLens, AFlatBoardIsNotBent) {
  for (const uint32_t seed : {3, 4, 5, 6}) {
    const auto solved = SolveLens(Views(KnownPinhole(), 30, 0.7, seed), kKnownImage);
    ASSERT_THAT(solved, IsOk());
    EXPECT_FALSE(solved->bend.has_value()) << seed;
  }
}

// Every second view shows the back. A bend is one of both sides together.
TEST(SolveLens, TakesViewsOfBothSidesOfABoard) {
  const Intrinsics lens = KnownPinhole();
  const Board board = *ParseBoard("board:charuco,10x7,0.03,0.022,5x5_100,two-sided=0.01");
  const auto poses = WavedBoard(board, lens, kKnownImage, 36, 0.3, 0.6, 0.7, 3, 0.85);
  for (const double height_m : {0.0, 0.002}) {
    std::mt19937 random(5);
    std::normal_distribution<double> noise(0, kNoisePx);
    std::vector<BoardView> views;
    for (size_t i = 0; i < poses.size(); ++i) {
      const bool is_back = i % 2 == 1;
      // Turned about the middle of the board, as who holds it turns it.
      const RigidTransform half_turn(Eigen::Quaterniond(0, 0, 1, 0),
                                     Eigen::Vector3d(0.24, 0, 0.01));
      const RigidTransform pose = is_back ? poses[i] * half_turn : poses[i];
      BoardView view;
      view.name = "view " + std::to_string(i);
      const auto points = board.Points();
      for (size_t p = 0; p < points.size(); ++p) {
        if ((board.SideOf(p) == BoardSide::kBack) != is_back) continue;
        Eigen::Vector3d at = points[p];
        at.z() += height_m * std::pow((at.x() - 0.12) / 0.12, 2);
        Eigen::Vector2d pixel;
        ASSERT_TRUE(Project(lens, pose * at, &pixel));
        pixel += Eigen::Vector2d(noise(random), noise(random));
        view.corners.push_back({points[p], pixel});
      }
      views.push_back(std::move(view));
    }
    const auto solved = SolveLens(views, kKnownImage);
    ASSERT_THAT(solved, IsOk());
    EXPECT_EQ(solved->views, 36);
    EXPECT_NEAR(solved->rms_px, kNoisePx * std::sqrt(2.0), 0.01);
    const auto difference = CompareLenses(lens, solved->intrinsics, kKnownImage);
    ASSERT_THAT(difference, IsOk());
    EXPECT_LT(difference->p95_px, 0.1);
    ASSERT_EQ(solved->bend.has_value(), height_m > 0);
    if (solved->bend) {
      EXPECT_NEAR(solved->bend->height_m.x(), height_m, 0.0003);
    }
  }
}

TEST(SolveLens, AFisheyeSolvedAsAPinholeIsWorse) {
  const auto views = Views(KnownFisheye(), 30);
  const auto fisheye = SolveLens(views, kKnownImage, {.model = LensModel::kFisheye});
  const auto pinhole = SolveLens(views, kKnownImage, {.model = LensModel::kPinhole4});
  ASSERT_THAT(fisheye, IsOk());
  ASSERT_THAT(pinhole, IsOk());
  EXPECT_GT(pinhole->held_out_rms_px, 3 * fisheye->held_out_rms_px);
  EXPECT_EQ(fisheye->candidates.size(), 1u);
}

TEST(SolveLens, LeavesOutWrongViewsAndCorners) {
  const Intrinsics lens = KnownPinhole();
  auto views = Views(lens, 30);
  for (BoardCorner& corner : views[4].corners) {
    corner.pixel.x() += 3 * std::sin(0.05 * corner.pixel.y());  // bent
  }
  views[7].corners[3].pixel.x() += 8;
  const auto solved = SolveLens(views, kKnownImage);
  ASSERT_THAT(solved, IsOk());
  EXPECT_THAT(solved->view_results[4].left_out, HasSubstr("fit"));
  EXPECT_THAT(solved->view_results[5].left_out, IsEmpty());
  EXPECT_EQ(solved->view_results[7].left_out_corners, 1);
  EXPECT_EQ(solved->views, static_cast<int>(views.size()) - 1);
  const auto difference = CompareLenses(lens, solved->intrinsics, kKnownImage);
  ASSERT_THAT(difference, IsOk());
  EXPECT_LT(difference->p95_px, 0.15);
}

TEST(SolveLens, RefusesTooFewViews) {
  auto views = Views(KnownPinhole(), 12);
  views.resize(5);
  EXPECT_THAT(SolveLens(views, kKnownImage),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("at least 6 pictures")));
  views[0].corners.resize(3);
  EXPECT_THAT(SolveLens(views, kKnownImage),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("view 0 has 3 corners")));
}

TEST(SolveLens, RefusesBoardsThatAreNeverTilted) {
  EXPECT_THAT(SolveLens(Views(KnownPinhole(), 24, 0.0), kKnownImage),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("focal length and distance cannot be told apart")));
}

TEST(SolveLens, AdvisesWhereTheImageIsBare) {
  const Intrinsics lens = KnownPinhole();
  auto views = Views(lens, 36);
  for (BoardView& view : views) {
    std::erase_if(view.corners, [](const BoardCorner& corner) { return corner.pixel.x() < 160; });
  }
  std::erase_if(views, [](const BoardView& view) { return view.corners.size() < 12; });
  const auto solved = SolveLens(views, kKnownImage);
  ASSERT_THAT(solved, IsOk());
  EXPECT_THAT(solved->advice, Contains(HasSubstr("no corner in the left fifth of the image")));
  EXPECT_THAT(solved->advice, Not(Contains(HasSubstr("right fifth"))));
}

TEST(LensModel, NamesRoundTrip) {
  for (const LensModel model : AllLensModels()) {
    EXPECT_EQ(*ParseLensModel(LensModelName(model)), model);
  }
  EXPECT_THAT(ParseLensModel("auto"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("\"auto\"")));
}

}  // namespace
}  // namespace rigcal::lens_solver_test
