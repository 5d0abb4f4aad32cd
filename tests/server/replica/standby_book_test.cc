// SPDX-License-Identifier: Apache-2.0
#include "server/replica/standby_book.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace rigcal::server::standby_book_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using std::chrono::seconds;
using ::testing::AllOf;
using ::testing::HasSubstr;

class StandbyBookTest : public ::testing::Test {
 protected:
  const StandbyBook::Clock::time_point start_ = StandbyBook::Clock::now();
  StoreChanges changes_;
  StandbyBook book_{&changes_};
};

TEST_F(StandbyBookTest, OneStandbyAtATime) {
  EXPECT_FALSE(book_.State(start_));
  ASSERT_THAT(book_.NoteAsked("a", "pc-1:7420", 0, start_), IsOk());
  EXPECT_THAT(book_.NoteAsked("b", "pc-2:7420", 0, start_ + seconds(3)),
              StatusIs(absl::StatusCode::kAlreadyExists,
                       AllOf(HasSubstr("pc-1:7420"), HasSubstr("pc-2:7420"))));
  // The first one has gone.
  EXPECT_FALSE(book_.IsConnected(start_ + seconds(10)));
  EXPECT_THAT(book_.NoteAsked("b", "pc-2:7420", 0, start_ + seconds(10)), IsOk());
  EXPECT_EQ(book_.State(start_ + seconds(10))->address, "pc-2:7420");
}

TEST_F(StandbyBookTest, SaysHowFarBehindTheStandbyIs) {
  changes_.NoteSession("wave", 100);
  ASSERT_THAT(book_.NoteAsked("a", "pc-1:7420", 0, start_), IsOk());
  EXPECT_EQ(book_.State(start_)->behind_rows, 100u);
  book_.NoteGiven(changes_.position(), changes_.row_count(), start_);
  ASSERT_THAT(book_.NoteAsked("a", "pc-1:7420", changes_.position(), start_ + seconds(1)), IsOk());
  EXPECT_EQ(book_.State(start_ + seconds(1))->behind_rows, 0u);
  changes_.NoteSession("wave", 16);
  EXPECT_EQ(book_.State(start_ + seconds(4))->behind_rows, 16u);
  EXPECT_DOUBLE_EQ(book_.State(start_ + seconds(4))->behind_s, 4);
}

TEST_F(StandbyBookTest, TellsListenersWhatIsDurable) {
  std::vector<StreamProgress> heard;
  const uint64_t number =
      book_.AddListener([&](const std::vector<StreamProgress>& streams) { heard = streams; });
  const StreamKey left{"wave", "left", 1};
  book_.NoteDurable({{.stream = left, .durable_seq = 12}});
  ASSERT_EQ(heard.size(), 1u);
  EXPECT_EQ(heard[0].durable_seq, 12u);
  EXPECT_EQ(book_.Of(left).durable_seq, 12u);
  EXPECT_EQ(book_.Of({"wave", "right", 1}).durable_seq, 0u);
  book_.RemoveListener(number);
  book_.NoteDurable({{.stream = left, .durable_seq = 13}});
  EXPECT_EQ(heard[0].durable_seq, 12u);
}

TEST_F(StandbyBookTest, IsSupersededOnce) {
  int times = 0;
  book_.OnSuperseded([&](uint64_t generation, const std::string& by) {
    ++times;
    EXPECT_EQ(generation, 2u);
    EXPECT_EQ(by, "pc-2:7420");
  });
  book_.Supersede(2, "pc-2:7420");
  book_.Supersede(3, "pc-3:7420");
  EXPECT_EQ(times, 1);
}

}  // namespace
}  // namespace rigcal::server::standby_book_test
