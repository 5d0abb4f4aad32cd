// SPDX-License-Identifier: Apache-2.0
// A store that copies another one's records again and again, as a standby does.
#include "server/store/replica.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/store/sqlite/sqlite_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::replica_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::CountsText;
using ::rigcal::testing::EndDelivery;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr char kId[] = "s-test";

class Replica : public ::testing::Test {
 protected:
  void SetUp() override {
    primary_ = Open("primary");
    standby_ = Open("standby");
    ASSERT_THAT(primary_->CreateSession(CapturingSession({"a", "b"})), IsOk());
  }
  std::unique_ptr<SqliteStore> Open(const std::string& name) {
    auto store =
        SqliteStore::Open({.data_directory = directory_.path() / name, .min_free_bytes = 0});
    EXPECT_THAT(store, IsOk());
    return *std::move(store);
  }
  absl::Status Copy(ReplicaKind kind, const std::string& id, bool anew = false) {
    std::vector<ReplicaStream> streams;
    if (!anew) streams = *standby_->ReplicaStreams(id);
    return standby_->WriteReplica(kind, id, anew, [&](const ReplicaTarget::TakeRows& take) {
      return primary_->ReadReplica(kind, id, streams, [&](std::vector<ReplicaRows> part) {
        for (const ReplicaRows& rows : part) copied_rows_ += rows.rows.size();
        return take(std::move(part));
      });
    });
  }
  void Append(const Delivery& delivery) { ASSERT_THAT(primary_->Append({&delivery, 1}), IsOk()); }
  void Append(uint32_t first, uint32_t last, const std::string& camera = "a") {
    Delivery delivery = MakeDelivery(MakeBatch(KeyOf(camera), first, last));
    delivery.batch.clock_samples = {
        {.device_ns = first, .host_monotonic_ns = int64_t{first} * 10, .host_utc_ns = 3}};
    Append(delivery);
  }
  void ExpectEqual() {
    EXPECT_EQ(CountsText(*standby_), CountsText(*primary_));
    EXPECT_EQ(ReadRows(*standby_), ReadRows(*primary_));
    const auto there = primary_->ListReplica();
    const auto here = standby_->ListReplica();
    ASSERT_THAT(there, IsOk());
    ASSERT_THAT(here, IsOk());
    ASSERT_EQ(here->sessions.size(), there->sessions.size());
    for (size_t i = 0; i < there->sessions.size(); ++i) {
      EXPECT_EQ(here->sessions[i].mark, there->sessions[i].mark);
    }
  }

  const ::rigcal::testing::TemporaryDirectory directory_;
  std::unique_ptr<SqliteStore> primary_;
  std::unique_ptr<SqliteStore> standby_;
  size_t copied_rows_ = 0;
};

TEST_F(Replica, CopiesOnlyWhatIsNew) {
  for (uint32_t i = 0; i < 50; ++i) Append(1 + 5 * i, 5 + 5 * i);
  ASSERT_THAT(Copy(ReplicaKind::kShared, ""), IsOk());
  ASSERT_THAT(Copy(ReplicaKind::kSession, kId), IsOk());
  ExpectEqual();
  const size_t first = copied_rows_;
  copied_rows_ = 0;
  Append(251, 255);
  ASSERT_THAT(Copy(ReplicaKind::kSession, kId), IsOk());
  ExpectEqual();
  EXPECT_LT(copied_rows_ + 60, first);
}

TEST_F(Replica, TakesRowsThatFillAGapLater) {
  Append(11, 20);
  Append(31, 40);
  ASSERT_THAT(Copy(ReplicaKind::kSession, kId), IsOk());
  Append(1, 10);
  Append(21, 30);
  Append(1, 4, "b");
  ASSERT_THAT(Copy(ReplicaKind::kSession, kId), IsOk());
  ExpectEqual();
  Delivery gap;
  gap.batch.stream = KeyOf("b");
  gap.batch.first_seq = 8;
  gap.batch.dropped = {{.first_seq = 5, .count = 3, .reason = RefusalReason::kSpoolFreed}};
  Append(gap);
  Append(EndDelivery(KeyOf("a"), 40));
  ASSERT_THAT(Copy(ReplicaKind::kSession, kId), IsOk());
  ExpectEqual();
  const auto progress = standby_->ReplicaProgress(kId);
  ASSERT_THAT(progress, IsOk());
  ASSERT_EQ(progress->size(), 2u);
  EXPECT_EQ((*progress)[0].durable_seq, 40u);
  EXPECT_TRUE((*progress)[0].complete);
  EXPECT_EQ((*progress)[1].durable_seq, 7u);
  EXPECT_FALSE((*progress)[1].complete);
}

TEST_F(Replica, GoesOnWhereThePrimaryWasAfterItIsOpenedAgain) {
  Append(1, 20);
  ASSERT_THAT(Copy(ReplicaKind::kShared, ""), IsOk());
  ASSERT_THAT(Copy(ReplicaKind::kSession, kId), IsOk());
  standby_.reset();
  standby_ = Open("standby");
  EXPECT_EQ(standby_->server_id(), primary_->server_id());
  const Delivery repeated = MakeDelivery(MakeBatch(KeyOf("a"), 11, 30));
  const auto outcome = standby_->Append({&repeated, 1});
  ASSERT_THAT(outcome, IsOk());
  EXPECT_EQ((*outcome)[0].duplicate_rows, 10u);
  EXPECT_EQ((*outcome)[0].stored_rows, 10u);
  EXPECT_EQ((*outcome)[0].durable_seq, 30u);
}

TEST_F(Replica, FollowsDeletedObservations) {
  Append(1, 20);
  Session session = *primary_->GetSession(kId);
  session.state = SessionState::kFinished;
  ASSERT_THAT(primary_->UpdateSession(session), IsOk());
  ASSERT_THAT(Copy(ReplicaKind::kSession, kId), IsOk());
  ASSERT_THAT(primary_->DeleteObservations(kId, 5), IsOk());
  // The rows that are here are more than the primary has: that is noticed, and read anew.
  EXPECT_THAT(Copy(ReplicaKind::kSession, kId),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("table batch differs")));
  EXPECT_EQ(ReadRows(*standby_).size(), 20u);
  ASSERT_THAT(Copy(ReplicaKind::kSession, kId, /*anew=*/true), IsOk());
  ExpectEqual();
  EXPECT_EQ(ReadRows(*standby_).size(), 0u);
}

TEST_F(Replica, ARecordThatIsGoneIsNotFoundAndCanBeErased) {
  Append(1, 20);
  ASSERT_THAT(Copy(ReplicaKind::kSession, kId), IsOk());
  ASSERT_THAT(primary_->DeleteSession(kId), IsOk());
  EXPECT_THAT(Copy(ReplicaKind::kSession, kId),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr(kId)));
  ASSERT_THAT(standby_->EraseReplica(ReplicaKind::kSession, kId), IsOk());
  EXPECT_THAT(standby_->GetSession(kId), StatusIs(absl::StatusCode::kNotFound, ::testing::_));
  ASSERT_THAT(Copy(ReplicaKind::kShared, ""), IsOk());
  // The id of a deleted session is not used again, here neither.
  EXPECT_THAT(standby_->CreateSession(CapturingSession({"a"})),
              StatusIs(absl::StatusCode::kAlreadyExists, ::testing::_));
}

TEST_F(Replica, RefusesRowsOfTablesThatItDoesNotHave) {
  for (const ReplicaRows& rows :
       {ReplicaRows{.table = "sqlite_master", .rows = {}},
        ReplicaRows{.table = "counter", .rows = {{.numbers = {1, 2}, .values = {"a"}}}}}) {
    EXPECT_THAT(
        standby_->WriteReplica(
            ReplicaKind::kShared, "", false,
            [&](const ReplicaTarget::TakeRows& take) -> absl::StatusOr<std::vector<ReplicaDigest>> {
              const absl::Status taken = take({rows});
              if (!taken.ok()) return taken;
              return std::vector<ReplicaDigest>();
            }),
        StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("of the same release")));
  }
}

TEST_F(Replica, ATakeoverRaisesTheGeneration) {
  EXPECT_EQ(*primary_->Generation(), 1u);
  ASSERT_THAT(Copy(ReplicaKind::kShared, ""), IsOk());
  EXPECT_EQ(*standby_->RaiseGeneration(), 2u);
  EXPECT_EQ(*standby_->Generation(), 2u);
  EXPECT_EQ(*primary_->Generation(), 1u);
}

}  // namespace
}  // namespace rigcal::server::replica_test
