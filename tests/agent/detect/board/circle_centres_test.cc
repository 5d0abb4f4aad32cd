// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/circle_centres.h"

#include <gtest/gtest.h>

#include "common/camera/camera_model.h"
#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"

namespace rigcal::agent::circle_centres_test {
namespace {

using namespace rigcal::testing;  // the known lens

struct Circles {
  Board board = *ParseBoard("board:circles-symmetric,6x5,0.03");
  cv::Mat image;
  std::vector<Eigen::Vector2d> pixels;  // where they are

  Circles() {
    const RigidTransform pose =
        BoardAt(board, KnownPinhole(), Eigen::Vector2d(320, 240), 0.5, {0.2, 0.1, 0.1});
    image = BoardRenderer(KnownPinhole(), kKnownImage).Render(board, pose, 0.7, 1);
    for (const Eigen::Vector3d& point : board.Points()) {
      EXPECT_TRUE(Project(KnownPinhole(), pose * point, &pixels.emplace_back()));
    }
  }
};

TEST(RefineCircles, FindsTheCentresNearby) {
  const Circles circles;
  std::vector<Eigen::Vector2d> pixels = circles.pixels;
  for (Eigen::Vector2d& pixel : pixels) pixel += Eigen::Vector2d(1.5, -1);
  EXPECT_TRUE(RefineCircles(circles.board, circles.image, &pixels));
  for (size_t i = 0; i < pixels.size(); ++i) {
    EXPECT_LT((pixels[i] - circles.pixels[i]).norm(), 0.3) << i;
  }
}

// As OpenCV fills circles that it has not found.
TEST(RefineCircles, APlaceBetweenCirclesIsNone) {
  const Circles circles;
  std::vector<Eigen::Vector2d> pixels = circles.pixels;
  pixels[7] = 0.25 * (pixels[7] + pixels[8] + pixels[13] + pixels[14]);
  EXPECT_FALSE(RefineCircles(circles.board, circles.image, &pixels));
}

TEST(RefineCircles, OneCircleIsNoTwo) {
  const Circles circles;
  std::vector<Eigen::Vector2d> pixels = circles.pixels;
  pixels[29] = pixels[28];
  EXPECT_FALSE(RefineCircles(circles.board, circles.image, &pixels));
}

}  // namespace
}  // namespace rigcal::agent::circle_centres_test
