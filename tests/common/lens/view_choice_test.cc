// SPDX-License-Identifier: Apache-2.0
#include "common/lens/view_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace rigcal {
namespace {

using Verdict = ViewChoice::Verdict;

constexpr ImageSize kImage{600, 800};  // its diagonal is 1000 pixels, 4 % of it 40

// Four corners of a square, of which some may be missing, with its upper left at (x, y).
BoardView SquareAt(double x, double y, const std::vector<int>& seen = {0, 1, 2, 3}) {
  BoardView view;
  for (const int i : seen) {
    const Eigen::Vector2d corner(i % 2, i / 2);
    view.corners.push_back(
        {{0.1 * corner.x(), 0.1 * corner.y(), 0}, Eigen::Vector2d(x, y) + 50 * corner, 0});
  }
  return view;
}

TEST(ViewChoiceTest, TakesViewsThatHaveMoved) {
  ViewChoice choice(kImage, {});
  EXPECT_EQ(choice.Offer(SquareAt(100, 100), 0), Verdict::kTaken);
  EXPECT_EQ(choice.Offer(SquareAt(139, 100), 0), Verdict::kAlike);
  EXPECT_EQ(choice.Offer(SquareAt(141, 100), 0), Verdict::kTaken);
  // As the first one, not as the last one.
  EXPECT_EQ(choice.Offer(SquareAt(95, 100), 0), Verdict::kAlike);
  EXPECT_EQ(choice.views().size(), 2u);
  EXPECT_EQ(choice.alike(), 2);
}

TEST(ViewChoiceTest, ComparesTheCornersThatBothShow) {
  ViewChoice choice(kImage, {});
  EXPECT_EQ(choice.Offer(SquareAt(100, 100, {0, 1}), 0), Verdict::kTaken);
  EXPECT_EQ(choice.Offer(SquareAt(100, 100, {1, 3}), 0), Verdict::kAlike);
  // None in common: another part of the board.
  EXPECT_EQ(choice.Offer(SquareAt(100, 100, {2}), 0), Verdict::kTaken);
}

TEST(ViewChoiceTest, LeavesOutWhatIsLessSharpThanOthers) {
  ViewChoice choice(kImage, {.sharp = 3});
  EXPECT_EQ(choice.Offer(SquareAt(0, 0), 2.0), Verdict::kTaken);
  EXPECT_EQ(choice.Offer(SquareAt(100, 0), 3.7), Verdict::kBlurred);
  EXPECT_EQ(choice.Offer(SquareAt(200, 0), 3.5), Verdict::kTaken);
  // 1.8 times the sharpest is 2.7, which is sharp anyway.
  EXPECT_EQ(choice.Offer(SquareAt(300, 0), 1.5), Verdict::kTaken);
  EXPECT_EQ(choice.Offer(SquareAt(400, 0), 2.9), Verdict::kTaken);
  EXPECT_EQ(choice.Offer(SquareAt(500, 0), 3.1), Verdict::kBlurred);
  EXPECT_EQ(choice.blurred(), 2);
}

TEST(ViewChoiceTest, ManyViewsAreSpreadOverAllThatWasOffered) {
  ViewChoice choice(kImage, {.most = 20});
  for (int y = 0; y < 700; y += 20) {
    for (int x = 0; x < 500; x += 20) choice.Offer(SquareAt(x, y), 0);
  }
  EXPECT_LE(choice.views().size(), 20u);
  EXPECT_GE(choice.views().size(), 10u);
  double right = 0, bottom = 0;
  for (const BoardView& view : choice.views()) {
    right = std::max(right, view.corners[0].pixel.x());
    bottom = std::max(bottom, view.corners[0].pixel.y());
  }
  EXPECT_GT(right, 350);
  EXPECT_GT(bottom, 500);
  EXPECT_EQ(choice.views().size() + static_cast<size_t>(choice.alike()), 35u * 25u);
}

}  // namespace
}  // namespace rigcal
