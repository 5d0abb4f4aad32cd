// SPDX-License-Identifier: Apache-2.0
#include "server/store/row_account.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <utility>

#include "tests/server/store/store_fixture.h"

namespace rigcal::server::row_account_test {
namespace {

using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Range = StreamAudit::Range;

constexpr uint32_t kNoLimit = std::numeric_limits<uint32_t>::max();

StoredBatch Readable(uint32_t first_seq, uint32_t last_seq, bool late = false) {
  StoredBatch stored;
  stored.batch = MakeBatch(KeyOf("a"), first_seq, last_seq);
  stored.late = late;
  return stored;
}

StoredBatch Damaged(uint32_t first_seq, uint32_t rows) {
  StoredBatch stored;
  stored.batch.first_seq = first_seq;
  stored.damaged_rows = rows;
  stored.damage = "damaged from " + std::to_string(first_seq);
  return stored;
}

RowAccount Account(uint32_t durable_seq, const std::vector<Range>& dropped = {},
                   uint32_t last_first_seq = kNoLimit) {
  StreamAudit audit;
  audit.durable_seq = durable_seq;
  return RowAccount(std::move(audit), dropped, last_first_seq);
}

TEST(RowAccount, AWholeStreamHasNoGaps) {
  RowAccount account = Account(30);
  account.Add(Readable(1, 10));
  account.Add(Readable(11, 25, /*late=*/true));
  account.Add(Readable(26, 30));
  const StreamAudit audit = std::move(account).Close();
  EXPECT_EQ(audit.stored_count, 30u);
  EXPECT_EQ(audit.late_count, 15u);
  EXPECT_EQ(audit.highest_seq, 30u);
  EXPECT_EQ(audit.damaged_count, 0u);
  EXPECT_EQ(audit.absent_count, 0u);
  EXPECT_THAT(audit.absent, IsEmpty());
}

TEST(RowAccount, SaysWhichRowsAreDamagedAndWhichAreNotThere) {
  RowAccount account = Account(40, {{31, 3}});
  account.Add(Damaged(1, 5));
  account.Add(Readable(6, 10));
  account.Add(Damaged(16, 5));
  account.Add(Damaged(21, 5));
  account.Add(Readable(50, 55));
  const StreamAudit audit = std::move(account).Close();
  EXPECT_EQ(audit.stored_count, 11u);
  EXPECT_EQ(audit.damaged_count, 15u);
  EXPECT_THAT(audit.damaged, ElementsAre(Range{1, 5}, Range{16, 10}));
  EXPECT_EQ(audit.damage, "damaged from 1");
  EXPECT_EQ(audit.highest_seq, 55u);
  EXPECT_THAT(audit.absent, ElementsAre(Range{11, 5}, Range{26, 5}, Range{34, 16}));
  EXPECT_EQ(audit.absent_count, 26u);
}

TEST(RowAccount, WhatIsThereTwiceShows) {
  RowAccount account = Account(10);
  account.Add(Readable(1, 10));
  account.Add(Readable(4, 6));
  const StreamAudit audit = std::move(account).Close();
  EXPECT_EQ(audit.stored_count, 13u);
  EXPECT_EQ(audit.absent_count, 0u);
}

TEST(RowAccount, ADamagedRecordEndsWhereTheNextOneBegins) {
  RowAccount account = Account(20);
  account.Add(Damaged(1, 4000));  // what it says about itself is damaged, too
  account.Add(Readable(11, 20));
  const StreamAudit audit = std::move(account).Close();
  EXPECT_THAT(audit.damaged.front(), (Range{1, 10}));
  EXPECT_EQ(audit.stored_count, 10u);
}

TEST(RowAccount, LeavesOutWhatCameWhileTheRestWasRead) {
  RowAccount account = Account(20, {}, 11);
  account.Add(Readable(1, 10));
  account.Add(Readable(11, 20));
  account.Add(Readable(21, 30));
  const StreamAudit audit = std::move(account).Close();
  EXPECT_EQ(audit.stored_count, 20u);
  EXPECT_EQ(audit.highest_seq, 20u);
}

TEST(RowAccount, ListsTheFirstRangesAndCountsAll) {
  constexpr uint32_t kGaps = 100;
  RowAccount account = Account(2 * kGaps);
  for (uint32_t i = 1; i <= kGaps; ++i) account.Add(Readable(2 * i, 2 * i));
  const StreamAudit audit = std::move(account).Close();
  EXPECT_EQ(audit.absent_count, kGaps);
  EXPECT_THAT(audit.absent, SizeIs(StreamAudit::kMaxRanges));
  EXPECT_EQ(audit.absent.front(), (Range{1, 1}));
}

TEST(RowAccount, AnEmptyStreamHasNothing) {
  const StreamAudit audit = Account(0).Close();
  EXPECT_EQ(audit.highest_seq, 0u);
  EXPECT_EQ(audit.absent_count, 0u);
}

}  // namespace
}  // namespace rigcal::server::row_account_test
