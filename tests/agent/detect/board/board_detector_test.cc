// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/board_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "common/lens/circle_image.h"
#include "common/statistics/robust_statistics.h"
#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::board_detector_test {
namespace {

using namespace rigcal::testing;  // the known lens

constexpr double kLensBlurPx = 0.7;

// Distances of the found points from where they are, in order; empty: not found.
std::vector<double> Errors(const Board& board, const Intrinsics& lens,
                           const BoardRenderer& renderer, const RigidTransform& pose,
                           double noise) {
  const cv::Mat image = renderer.Render(board, pose, kLensBlurPx, noise);
  const auto seen = FindBoard(board, MonoView(image));
  EXPECT_THAT(seen, IsOk());
  std::vector<double> errors;
  if (!seen.ok() || !seen->has_value()) return errors;
  const auto points = board.Points();
  for (size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector2d pixel;
    EXPECT_TRUE(Project(lens, pose * points[i], &pixel));
    if (const double diameter_m = board.CircleDiameter(); diameter_m > 0) {
      Eigen::Vector2d offset_px;
      EXPECT_TRUE(CircleOffset(lens, pose, points[i], 0.5 * diameter_m, &offset_px));
      pixel += offset_px;
    }
    errors.push_back(((*seen)->pixels[i] - pixel).norm());
  }
  return errors;
}

TEST(BoardDetector, FindsCheckersWhereTheyAreInTheirOrder) {
  const Board board = *ParseBoard("board:checker,9x6,0.03");
  for (const Intrinsics& lens : {KnownPinhole(), KnownFisheye()}) {
    const bool wide = lens.model == DistortionModel::kFisheye;
    const BoardRenderer renderer(lens, kKnownImage);
    // Upright, upside down, on its side, tilted.
    for (const Eigen::Vector3d& turn :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.1, 0, 3.1), Eigen::Vector3d(0, 0.2, 1.5),
          Eigen::Vector3d(0.8, 0.2, -0.3)}) {
      const auto pose = BoardAt(board, lens, Eigen::Vector2d(310, 235), wide ? 0.3 : 0.5, turn);
      const auto errors = Errors(board, lens, renderer, pose, 0);
      ASSERT_EQ(errors.size(), 54u) << "wide " << wide << " turn " << turn.transpose();
      EXPECT_LT(Median(errors), 0.02);
      EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.06);
      const auto noisy = Errors(board, lens, renderer, pose, 1);
      ASSERT_EQ(noisy.size(), 54u);
      EXPECT_LT(Median(noisy), 0.025);
    }
  }
}

TEST(BoardDetector, TheFirstPixelsCentreIsTheOrigin) {
  // The mean error of many corners shows a shift of the convention, not their noise.
  const Board board = *ParseBoard("board:checker,9x6,0.03");
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  const auto pose = BoardAt(board, lens, Eigen::Vector2d(300, 250), 0.5, {0.3, 0.2, 0.1});
  const cv::Mat image = renderer.Render(board, pose, kLensBlurPx, 1);
  const auto seen = FindBoard(board, MonoView(image));
  ASSERT_THAT(seen, IsOk());
  ASSERT_TRUE(seen->has_value());
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < 54; ++i) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(Project(lens, pose * board.Points()[i], &pixel));
    mean += ((*seen)->pixels[i] - pixel) / 54;
  }
  EXPECT_LT(mean.norm(), 0.02);
  EXPECT_GT((*seen)->edge_width_px, 1);
  EXPECT_LT((*seen)->edge_width_px, 3.5);
  const cv::Mat soft = renderer.Render(board, pose, 3, 1);
  const auto blurred = FindBoard(board, MonoView(soft));
  ASSERT_THAT(blurred, IsOk());
  ASSERT_TRUE(blurred->has_value());
  EXPECT_GT((*blurred)->edge_width_px, 2 * (*seen)->edge_width_px);
}

TEST(BoardDetector, FindsCirclesOfBothKinds) {
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  for (const char* text : {"board:circles,4x11,0.02", "board:circles-symmetric,9x6,0.03"}) {
    const Board board = *ParseBoard(text);
    for (const Eigen::Vector3d& turn : {Eigen::Vector3d(0, 0, 0.1), Eigen::Vector3d(0.3, 0.2, -0.2),
                                        Eigen::Vector3d(0.9, 0.1, -0.2)}) {
      const auto pose = BoardAt(board, lens, Eigen::Vector2d(310, 235), 0.5, turn);
      const auto errors = Errors(board, lens, renderer, pose, 1);
      ASSERT_EQ(errors.size(), static_cast<size_t>(board.point_count())) << text;
      EXPECT_LT(Median(errors), 0.04) << text;
      EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.2) << text;
    }
  }
}

TEST(BoardDetector, FindsNothingWhereThereIsNothing) {
  const cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(90));
  for (const char* text : {"board:checker,9x6,0.03", "board:circles,4x11,0.02"}) {
    const auto seen = FindBoard(*ParseBoard(text), MonoView(grey));
    ASSERT_THAT(seen, IsOk());
    EXPECT_FALSE(seen->has_value());
  }
}

}  // namespace
}  // namespace rigcal::agent::board_detector_test
