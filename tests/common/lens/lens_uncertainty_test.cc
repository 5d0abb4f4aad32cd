// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_uncertainty.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/lens/lens_adjustment.h"
#include "common/lens/lens_difference.h"
#include "common/lens/lens_solver.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::lens_uncertainty_test {
namespace {

using namespace rigcal::testing;  // the known lens

constexpr double kNoisePx = 0.1;
constexpr int kDraws = 80;

const Board kBoard = *ParseBoard("board:checker,9x6,0.03");

// What is stated after one look at a board is what many looks with other noise do.
void ExpectMapIsThatOfManyDraws(LensModel model, const Intrinsics& lens, double nearest_m,
                                double farthest_m) {
  SCOPED_TRACE(LensModelName(model));
  const auto poses = WavedBoard(kBoard, lens, kKnownImage, 24, nearest_m, farthest_m, 0.8, 4, 0.6);
  auto views = SeenBoards(kBoard, lens, kKnownImage, poses, kNoisePx, 1);
  const auto solved = SolveLens(views, kKnownImage, {.model = model});
  ASSERT_THAT(solved, IsOk());
  EXPECT_NEAR(solved->noise_px, kNoisePx, 0.1 * kNoisePx);
  const std::vector<double>& stated = solved->uncertainty.map_px;
  ASSERT_EQ(stated.size(), static_cast<size_t>(LensDifference::kColumns * LensDifference::kRows));

  LensEstimate start = {.model = model, .intrinsics = solved->intrinsics, .cam_from_board = {}};
  for (const LensViewResult& view : solved->view_results) {
    ASSERT_EQ(view.left_out, "");
    start.cam_from_board.push_back(view.cam_from_board);
  }
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, kNoisePx);
  std::vector<double> squares(stated.size(), 0.0);
  for (int draw = 0; draw < kDraws; ++draw) {
    for (size_t i = 0; i < views.size(); ++i) {
      for (BoardCorner& corner : views[i].corners) {
        Eigen::Vector2d pixel;
        ASSERT_TRUE(
            Project(solved->intrinsics, start.cam_from_board[i] * corner.x_in_board_m, &pixel));
        corner.pixel = pixel + Eigen::Vector2d(noise(random), noise(random));
      }
    }
    const LensAdjustment drawn = AdjustLens(views, start);
    const auto difference =
        CompareLenses(solved->intrinsics, drawn.estimate.intrinsics, kKnownImage);
    ASSERT_THAT(difference, IsOk());
    for (size_t k = 0; k < squares.size(); ++k) {
      squares[k] += std::pow(difference->map_px[k], 2) / kDraws;
    }
  }
  double lowest = 100, highest = 0;
  for (size_t k = 0; k < squares.size(); ++k) {
    ASSERT_TRUE(std::isfinite(stated[k])) << k;
    const double ratio = std::sqrt(squares[k]) / stated[k];
    lowest = std::min(lowest, ratio);
    highest = std::max(highest, ratio);
  }
  EXPECT_GT(lowest, 1 / 1.3);
  EXPECT_LT(highest, 1.3);
  EXPECT_GT(solved->uncertainty.p95_px, 1.2 * solved->uncertainty.median_px);
}

TEST(LensUncertainty, IsWhatManyDrawsOfNoiseDoToAPinhole) {
  ExpectMapIsThatOfManyDraws(LensModel::kPinhole5, KnownPinhole(), 0.4, 0.7);
}

TEST(LensUncertainty, IsWhatManyDrawsOfNoiseDoToAFisheye) {
  ExpectMapIsThatOfManyDraws(LensModel::kFisheye, KnownFisheye(), 0.2, 0.35);
}

TEST(LensUncertainty, TakesTheRotationOut) {
  // Of a long lens a shifted principal point is nearly a rotation.
  const Intrinsics lens = {
      .fx_px = 4000, .fy_px = 4000, .cx_px = 320, .cy_px = 240, .distortion = {0, 0, 0, 0, 0}};
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(8, 8);
  covariance(2, 2) = 25;
  const LensSensitivity sensitivity(LensModel::kPinhole4, lens, kKnownImage);
  EXPECT_LT(sensitivity.Of(covariance).p95_px, 0.1);
  covariance.setZero();
  covariance(0, 0) = 1600;  // 1 %: 3.2 px at the left border
  EXPECT_NEAR(sensitivity.Of(covariance).p95_px, 0.01 * 319.5 * 0.95, 0.2);
}

TEST(LensUncertainty, IsInfiniteForWhatIsNotDetermined) {
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(8, 8);
  information(1, 1) = 1e12;
  EXPECT_NEAR(CovarianceOf(information)(1, 1), 1e-12, 1e-18);
  information(0, 1) = information(1, 0) = 1e6;  // the first two cannot be told apart
  EXPECT_EQ(CovarianceOf(information).size(), 0);
  const LensSensitivity sensitivity(LensModel::kPinhole4, KnownPinhole(), kKnownImage);
  EXPECT_TRUE(std::isinf(sensitivity.Of({}).p95_px));
  EXPECT_TRUE(std::isinf(sensitivity.MeanVariance({})));
}

TEST(LensUncertainty, IsNoNumberWhereTheLensHasNoRay) {
  Intrinsics fold = KnownPinhole();
  fold.distortion = {-0.6, 0, 0, 0, 0};  // monotone only around the middle
  const LensSensitivity sensitivity(LensModel::kPinhole5, fold, kKnownImage);
  const LensUncertainty uncertainty = sensitivity.Of(Eigen::MatrixXd::Identity(9, 9));
  EXPECT_TRUE(std::isnan(uncertainty.map_px.front()));
  EXPECT_TRUE(std::isfinite(uncertainty.map_px[uncertainty.map_px.size() / 2 + 15]));
  EXPECT_TRUE(std::isfinite(uncertainty.p95_px));
}

}  // namespace
}  // namespace rigcal::lens_uncertainty_test
