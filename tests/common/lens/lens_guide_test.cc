// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_guide.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/lens/lens_difference.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::lens_guide_test {
namespace {

using namespace rigcal::testing;  // the known lens
using ::testing::HasSubstr;

const Board kBoard = *ParseBoard("board:checker,9x6,0.03");

// Who does exactly what is advised.
std::vector<BoardView> FollowAdvice(const Board& board, const Intrinsics& lens, double noise_px,
                                    int most, LensGuide* guide) {
  std::vector<BoardView> views;
  while (static_cast<int>(views.size()) < most && !guide->is_enough()) {
    const auto pose = PoseOf(guide->next(), board.Points(), lens, kKnownImage, views);
    if (!pose) break;
    auto seen = SeenBoards(board, lens, kKnownImage, {*pose}, noise_px,
                           static_cast<uint32_t>(views.size()));
    if (seen.empty()) break;
    seen[0].name = "view " + std::to_string(views.size());
    views.push_back(seen[0]);
    guide->Follow(views);
  }
  return views;
}

TEST(LensGuide, LeadsToTheTarget) {
  for (const Intrinsics& lens : {KnownPinhole(), KnownFisheye()}) {
    LensGuide guide(kBoard.Points(), kKnownImage, {.model = std::nullopt, .until_px = 0.2});
    const auto views = FollowAdvice(kBoard, lens, 0.1, 40, &guide);
    EXPECT_TRUE(guide.is_enough());
    EXPECT_GE(views.size(), 10u);
    EXPECT_LE(views.size(), 25u);
    ASSERT_TRUE(guide.solution());
    EXPECT_LE(guide.solution()->uncertainty.p95_px, 0.2);
    EXPECT_TRUE(guide.solution()->halves.has_value());
    const auto difference = CompareLenses(lens, guide.solution()->intrinsics, kKnownImage);
    ASSERT_THAT(difference, IsOk());
    EXPECT_LT(difference->p95_px, 0.5);
  }
}

// Going on from the last solve comes to what a solve from nothing does.
TEST(LensGuide, GoesOnToTheSameLens) {
  const Intrinsics lens = KnownPinhole();
  const auto all = SeenBoards(kBoard, lens, kKnownImage,
                              WavedBoard(kBoard, lens, kKnownImage, 20, 0.35, 0.6, 0.7, 3), 0.1, 1);
  LensGuide guide(kBoard.Points(), kKnownImage, {});
  std::vector<BoardView> views;
  for (const BoardView& view : all) {
    views.push_back(view);
    guide.Follow(views);
    if (views.size() < 6) {
      EXPECT_FALSE(guide.solution());
    }
  }
  const auto complete = SolveLens(all, kKnownImage);
  ASSERT_THAT(complete, IsOk());
  ASSERT_TRUE(guide.solution());
  EXPECT_EQ(guide.solution()->model, complete->model);
  const auto difference =
      CompareLenses(guide.solution()->intrinsics, complete->intrinsics, kKnownImage);
  ASSERT_THAT(difference, IsOk());
  EXPECT_LT(difference->p95_px, 0.02);
  EXPECT_NEAR(guide.solution()->uncertainty.p95_px, complete->uncertainty.p95_px,
              0.05 * complete->uncertainty.p95_px);
  EXPECT_FALSE(guide.is_enough());
}

// Of a large board some corners do between views; what is known is that of all.
TEST(LensGuide, StatesWhatAllCornersOfALargeBoardTell) {
  const Board board = *ParseBoard("board:checker,17x12,0.015");
  const Intrinsics lens = KnownPinhole();
  const auto views =
      SeenBoards(board, lens, kKnownImage,
                 WavedBoard(board, lens, kKnownImage, 16, 0.35, 0.6, 0.7, 3), 0.1, 1);
  LensGuide guide(board.Points(), kKnownImage, {.model = LensModel::kPinhole5});
  guide.Follow(views);
  const auto complete = SolveLens(views, kKnownImage, {.model = LensModel::kPinhole5});
  ASSERT_THAT(complete, IsOk());
  ASSERT_TRUE(guide.solution());
  EXPECT_LT(guide.solution()->corners, 0.7 * complete->corners);
  EXPECT_NEAR(guide.solution()->uncertainty.p95_px, complete->uncertainty.p95_px,
              0.15 * complete->uncertainty.p95_px);
}

// Boards that are never tilted make no lens: the list goes on.
TEST(LensGuide, GoesOnWithItsListWhereNoLensIsFound) {
  const Intrinsics lens = KnownPinhole();
  const auto views = SeenBoards(kBoard, lens, kKnownImage,
                                WavedBoard(kBoard, lens, kKnownImage, 8, 0.5, 0.6, 0.0, 3), 0.1, 1);
  LensGuide guide(kBoard.Points(), kKnownImage, {});
  guide.Follow(views);
  EXPECT_FALSE(guide.solution());
  EXPECT_THAT(guide.next().words, HasSubstr("turned away from the camera by about 30 degrees"));
  EXPECT_TRUE(std::isnan(guide.next().expected_p95_px));
}

}  // namespace
}  // namespace rigcal::lens_guide_test
