// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/marker_mistakes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"

namespace rigcal::agent::marker_mistakes_test {
namespace {

using namespace rigcal::testing;  // the known lens
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<cv::Mat> Pictures(const char* text, bool mirrored = false) {
  const Board board = *ParseBoard(text);
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  const double upright = board.kind == BoardKind::kAprilGrid ? M_PI : 0;  // its y points up
  std::vector<cv::Mat> pictures;
  for (const double turn : {0.0, 0.3}) {
    cv::Mat picture = renderer.Render(
        board, BoardAt(board, lens, Eigen::Vector2d(310, 235), 0.4, {upright + turn, turn, 0.1}),
        0.5, 1);
    if (mirrored) cv::flip(picture, picture, 1);
    pictures.push_back(picture);
  }
  return pictures;
}

std::string Explain(const char* told, const std::vector<cv::Mat>& pictures) {
  return ExplainMissingMarkers(*ParseBoard(told), pictures);
}

constexpr char kCharuco[] = "board:charuco,8x6,0.03,0.022,5x5_100";
constexpr char kApril[] = "board:aprilgrid,4x3,0.035,0.3";

TEST(ExplainMissingMarkers, MirroredPictures) {
  EXPECT_THAT(Explain(kCharuco, Pictures(kCharuco, true)), HasSubstr("in 2 of the 2"));
  EXPECT_THAT(Explain(kApril, Pictures(kApril, true)), HasSubstr("mirrored"));
}

TEST(ExplainMissingMarkers, AnotherDictionary) {
  EXPECT_THAT(Explain("board:charuco,8x6,0.03,0.022,4x4_250", Pictures(kCharuco)),
              HasSubstr("dictionary 5x5 (numbers up to 23): say 5x5_50"));
  EXPECT_THAT(Explain(kCharuco, Pictures("board:charuco,8x6,0.03,0.022,apriltag_36h11")),
              HasSubstr("apriltag_36h11 (numbers up to 23): say apriltag_36h11"));
}

TEST(ExplainMissingMarkers, AnotherKindOfBoard) {
  EXPECT_THAT(Explain("board:charuco,8x6,0.03,0.022,apriltag_36h11", Pictures(kApril)),
              HasSubstr("board:aprilgrid"));
  EXPECT_THAT(Explain(kApril, Pictures("board:charuco,8x6,0.03,0.022,apriltag_36h11")),
              HasSubstr("border of one bit"));
}

TEST(ExplainMissingMarkers, OtherCounts) {
  EXPECT_THAT(Explain("board:charuco,5x4,0.03,0.022,5x5_100", Pictures(kCharuco)),
              HasSubstr("numbers up to 23, and 5x4 squares have 10 of them"));
  EXPECT_THAT(Explain("board:aprilgrid,3x2,0.035,0.3", Pictures(kApril)),
              HasSubstr("numbers up to 11, and 3x2 tags have 6 of them"));
}

TEST(ExplainMissingMarkers, TheBackOfABoardWithTwoSides) {
  const Board board = *ParseBoard("board:charuco,8x6,0.03,0.022,5x5_100,two-sided=0.004");
  const Intrinsics lens = KnownPinhole();
  const auto from_behind =
      BoardAt(board, lens, Eigen::Vector2d(310, 235), 0.4, Eigen::Vector3d(0.1, M_PI + 0.2, 0));
  const std::vector<cv::Mat> pictures = {
      BoardRenderer(lens, kKnownImage).Render(board, from_behind, 0.5, 1)};
  EXPECT_THAT(Explain(kCharuco, pictures), HasSubstr("the back of a board"));
}

TEST(ExplainMissingMarkers, NothingToSay) {
  EXPECT_THAT(Explain(kCharuco, {cv::Mat(480, 640, CV_8UC1, cv::Scalar(90))}), IsEmpty());
  EXPECT_THAT(Explain(kCharuco, Pictures("board:checker,9x6,0.03")), IsEmpty());
  EXPECT_THAT(Explain(kCharuco, {}), IsEmpty());
}

}  // namespace
}  // namespace rigcal::agent::marker_mistakes_test
