// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/board_counts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"

namespace rigcal::agent::board_counts_test {
namespace {

using namespace rigcal::testing;  // the known lens

std::vector<cv::Mat> Pictures(const char* text) {
  const Board board = *ParseBoard(text);
  const Intrinsics lens = KnownPinhole();
  const BoardRenderer renderer(lens, kKnownImage);
  std::vector<cv::Mat> pictures;
  for (const double turn : {0.0, 0.3}) {
    pictures.push_back(renderer.Render(
        board, BoardAt(board, lens, Eigen::Vector2d(310, 235), 0.5, {turn, turn, 0.1}), 0.7, 1));
  }
  return pictures;
}

TEST(GuessCounts, SquaresWereCounted) {
  const auto guess =
      GuessCounts(*ParseBoard("board:checker,9x6,0.03"), Pictures("board:checker,8x5,0.03"));
  ASSERT_TRUE(guess.has_value());
  EXPECT_EQ(FormatBoard(guess->board), "board:checker,8x5,0.03");
  EXPECT_EQ(guess->pictures, 2);
}

TEST(GuessCounts, CirclesWereSwapped) {
  const auto guess =
      GuessCounts(*ParseBoard("board:circles,11x4,0.02"), Pictures("board:circles,4x11,0.02"));
  ASSERT_TRUE(guess.has_value());
  EXPECT_EQ(FormatBoard(guess->board), "board:circles,4x11,0.02");
}

TEST(GuessCounts, NothingIsNothing) {
  const std::vector<cv::Mat> pictures = {cv::Mat(480, 640, CV_8UC1, cv::Scalar(90))};
  EXPECT_FALSE(GuessCounts(*ParseBoard("board:checker,9x6,0.03"), pictures).has_value());
}

}  // namespace
}  // namespace rigcal::agent::board_counts_test
