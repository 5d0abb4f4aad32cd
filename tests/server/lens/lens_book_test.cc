// SPDX-License-Identifier: Apache-2.0
#include "server/lens/lens_book.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "tests/common/lens/known_lens.h"
#include "tests/server/lens/board_session.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::lens_book_test {
namespace {

using server::LensBook;
using State = server::SessionLens::State;
using ::testing::HasSubstr;

class LensBookTest : public StoreFixture {
 protected:
  void SetUp() override {
    StoreFixture::SetUp();
    ASSERT_THAT(store().CreateSession(OfBoard(CapturingSession({"left", "right"}))), IsOk());
    book_ = std::make_unique<LensBook>(
        &store(), server::LensBookOptions{.most_lenses = 2,
                                          .rest_ratio = 0,
                                          .shortest_rest = std::chrono::milliseconds(0),
                                          .nice = 0});
  }
  void TearDown() override { book_.reset(); }
  // What is known when nothing is being made any more.
  LensBook::Answer Made(const std::string& camera = "left") {
    EXPECT_THAT(book_->Get("s-test", camera), IsOk());
    book_->WaitIdle();
    return *book_->Get("s-test", camera);
  }

  std::unique_ptr<LensBook> book_;
};

TEST_F(LensBookTest, MakesTheLensOfACameraWithoutOne) {
  ASSERT_OK_AND_ASSIGN(const LensBook::Answer first, book_->Get("s-test", "left"));
  EXPECT_EQ(first.lens->state, State::kReading);
  EXPECT_EQ(Made().lens->state, State::kCollecting);
  EXPECT_THAT(Made().lens->problem, HasSubstr("nothing has been recorded"));

  Append(RowsOfViews(KeyOf("left"), 1, WavedViews(4)));
  const LensBook::Answer few = Made();
  EXPECT_EQ(few.lens->state, State::kCollecting);
  EXPECT_THAT(few.lens->problem, HasSubstr("there are 4 views that differ"));
  EXPECT_GT(few.lens->covered_share, 0);
  EXPECT_FALSE(few.lens->next_view.words.empty());
  EXPECT_TRUE(few.lens->next_view.outline_px.empty());

  Append(RowsOfViews(KeyOf("left"), 5, WavedViews(12, 2)));
  const LensBook::Answer made = Made();
  ASSERT_EQ(made.lens->state, State::kSolved) << made.lens->problem;
  EXPECT_EQ(made.stored_count, 16u);
  EXPECT_EQ(made.lens->solution_observation_count, 16u);
  EXPECT_NEAR(made.lens->solution->intrinsics.fx_px, KnownPinhole().fx_px, 2);
  EXPECT_EQ(made.lens->solution_times_ns.size(), made.lens->seen.views.size());
  EXPECT_EQ(made.lens->solution->view_results.size(), made.lens->seen.views.size());
  EXPECT_EQ(made.lens->next_view.outline_px.size(), 4u);
  EXPECT_LT(made.lens->next_view.expected_p95_px, made.lens->solution->uncertainty.p95_px);
}

TEST_F(LensBookTest, MakesNothingAnewWithoutNewObservations) {
  Append(RowsOfViews(KeyOf("left"), 1, WavedViews(3)));
  const auto made = Made().lens;
  EXPECT_EQ(Made().lens, made);
  Append(RowsOfViews(KeyOf("left"), 4, WavedViews(2, 3)));
  const auto again = Made().lens;
  EXPECT_NE(again, made);
  EXPECT_EQ(again->seen.observation_count, 5u);
}

TEST_F(LensBookTest, RestsBetweenTwoLenses) {
  book_ = std::make_unique<LensBook>(
      &store(), server::LensBookOptions{.shortest_rest = std::chrono::hours(1), .nice = 0});
  Append(RowsOfViews(KeyOf("left"), 1, WavedViews(3)));
  const auto made = Made().lens;
  Append(RowsOfViews(KeyOf("left"), 4, WavedViews(3, 3)));
  const LensBook::Answer rests = Made();
  EXPECT_EQ(rests.lens, made);
  EXPECT_EQ(rests.stored_count, 6u);
  EXPECT_EQ(rests.lens->seen.observation_count, 3u);
}

TEST_F(LensBookTest, ViewsThatMakeNoLensSayWhy) {
  // Never tilted: distance and focal length cannot be told apart.
  const Board board = *ParseBoard("board:checker,9x6,0.03");
  Append(RowsOfViews(
      KeyOf("left"), 1,
      SeenBoards(board, KnownPinhole(), kKnownImage,
                 WavedBoard(board, KnownPinhole(), kKnownImage, 8, 0.3, 0.5, 0.0, 1), 0.05, 1)));
  const auto lens = Made().lens;
  EXPECT_EQ(lens->state, State::kFailed);
  EXPECT_THAT(lens->problem, HasSubstr("cannot be told apart"));
  EXPECT_FALSE(lens->solution);
}

TEST_F(LensBookTest, ForgetsWhatNobodyAsksFor) {
  ASSERT_THAT(store().CreateSession([] {
    Session other = OfBoard(CapturingSession({"left"}));
    other.id = "s-other";
    return other;
  }()),
              IsOk());
  Append(RowsOfViews(KeyOf("left"), 1, WavedViews(3)));
  const auto left = Made("left").lens;
  Made("right");
  ASSERT_THAT(book_->Get("s-other", "left"), IsOk());
  book_->WaitIdle();
  // It was the one that nobody had asked for longest.
  ASSERT_OK_AND_ASSIGN(const LensBook::Answer anew, book_->Get("s-test", "left"));
  EXPECT_EQ(anew.lens->state, State::kReading);
}

TEST_F(LensBookTest, NamesWhatIsNotThere) {
  EXPECT_THAT(book_->Get("s-none", "left"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("s-none")));
  EXPECT_THAT(book_->Get("s-test", "top"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("left, right")));
}

}  // namespace
}  // namespace rigcal::testing::lens_book_test
