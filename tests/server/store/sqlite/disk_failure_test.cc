// SPDX-License-Identifier: Apache-2.0
// Every write and sync fails once: acknowledged rows stay, nothing is stored twice, the store
// recovers from a full disk, and after any other failure nothing is written any more.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "server/store/sqlite/sqlite_store.h"
#include "tests/server/store/sqlite/faulty_vfs.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::disk_failure_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::CountsText;
using ::rigcal::testing::FaultyVfs;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::_;
using ::testing::HasSubstr;

constexpr uint32_t kBatchRows = 40;
constexpr int kBatches = 12;

class DiskFailure : public ::testing::Test {
 protected:
  void SetUp() override { vfs_.Heal(); }
  void TearDown() override {
    store_.reset();
    vfs_.Heal();
  }

  void OpenNewStore() {
    store_.reset();
    vfs_.Heal();
    directory_ = std::make_unique<TemporaryDirectory>();
    options_ = {};
    options_.data_directory = directory_->path();
    options_.reserve_bytes = 1u << 20;
    options_.checkpoint_bytes = 64u << 10;  // so that there are several
    options_.vfs = vfs_.name();
    ASSERT_OK_AND_ASSIGN(store_, SqliteStore::Open(options_));
    ASSERT_THAT(store_->CreateSession(CapturingSession({"a"})), IsOk());
  }

  absl::StatusOr<AppendOutcome> AppendNext(uint32_t first_seq, uint32_t rows = kBatchRows) {
    const Delivery delivery = MakeDelivery(MakeBatch(KeyOf("a"), first_seq, first_seq + rows - 1));
    absl::StatusOr<std::vector<AppendOutcome>> outcomes = store_->Append({&delivery, 1});
    if (!outcomes.ok()) return outcomes.status();
    return outcomes->front();
  }

  // Appends batch after batch until one fails or all are in; returns what was acknowledged.
  uint32_t AppendUntilFailure(absl::Status* failure) {
    uint32_t durable_seq = 0;
    for (int batch = 0; batch < kBatches; ++batch) {
      const absl::StatusOr<AppendOutcome> outcome = AppendNext(durable_seq + 1);
      if (!outcome.ok()) {
        *failure = outcome.status();
        break;
      }
      durable_seq = outcome->durable_seq;
    }
    return durable_seq;
  }

  // The rows are 1 to n without a gap or a repetition, n at least `acknowledged`.
  uint32_t CheckRows(uint32_t acknowledged) {
    uint32_t last = 0;
    for (const auto& [key, row] : ReadRows(*store_)) EXPECT_EQ(std::get<2>(key), ++last);
    EXPECT_GE(last, acknowledged);
    const auto counts = store_->GetSessionCounts("s-test");
    EXPECT_THAT(counts, IsOk());
    EXPECT_EQ(counts->at(0).observation_count, last);
    return last;
  }

  FaultyVfs& vfs_ = FaultyVfs::Get();
  std::unique_ptr<TemporaryDirectory> directory_;
  SqliteStoreOptions options_;
  std::unique_ptr<SqliteStore> store_;
};

// A process that is killed leaves what it has written to the system; a power cut only what was
// synced.
TEST_F(DiskFailure, SyncsBeforeItAnswers) {
  OpenNewStore();
  const auto expect_sync = [this](const char* what, const std::function<absl::Status()>& write) {
    const int64_t before = vfs_.sync_count();
    EXPECT_THAT(write(), IsOk());
    EXPECT_GT(vfs_.sync_count(), before) << what;
  };
  for (uint32_t batch = 0; batch < 20; ++batch) {
    expect_sync("observations", [&] { return AppendNext(1 + 10 * batch, 10).status(); });
  }
  Session session = CapturingSession({"a"});
  expect_sync("session", [&] { return store_->UpdateSession(session); });
  Calibration calibration;
  calibration.rig = "rig";
  expect_sync("calibration", [&] { return store_->CreateCalibration(calibration).status(); });
  expect_sync("deletion", [&] { return store_->DeleteSession("s-test"); });
}

TEST_F(DiskFailure, StopsWritingAfterAFailedWriteOrSyncAndKeepsWhatWasAcknowledged) {
  int failures = 0;
  for (int64_t operation = 1; !HasFailure(); ++operation) {
    SCOPED_TRACE(::testing::Message() << "operation " << operation);
    OpenNewStore();
    vfs_.FailAt(operation, SQLITE_IOERR_WRITE, /*lasting=*/false);
    vfs_.SetSyncCode(SQLITE_IOERR_FSYNC);
    absl::Status failure;
    const uint32_t acknowledged = AppendUntilFailure(&failure);
    if (vfs_.fault_count() == 0) break;  // there are no more operations to fail
    ++failures;
    // Where the fault hit a checkpoint, the next transaction says so; at the end there is none.
    const absl::StatusOr<AppendOutcome> again = AppendNext(acknowledged + 1);
    EXPECT_THAT(again, StatusIs(absl::StatusCode::kInternal, HasSubstr("restart the server")));
    EXPECT_THAT(store_->UpdateSession(CapturingSession({"a"})),
                StatusIs(absl::StatusCode::kInternal, _));
    EXPECT_THAT(store_->GetSession("s-test"), IsOk());  // reading goes on

    store_.reset();
    vfs_.Heal();
    ASSERT_OK_AND_ASSIGN(store_, SqliteStore::Open(options_));
    const uint32_t stored = CheckRows(acknowledged);
    ASSERT_OK_AND_ASSIGN(const AppendOutcome outcome, AppendNext(1, stored + 5));
    EXPECT_EQ(outcome.stored_rows, 5u);
  }
  EXPECT_GT(failures, 40);
}

TEST_F(DiskFailure, GetsOverADiskThatIsFullForAMoment) {
  int failures = 0;
  for (int64_t operation = 1; !HasFailure(); ++operation) {
    SCOPED_TRACE(::testing::Message() << "operation " << operation);
    OpenNewStore();
    vfs_.FailAt(operation, SQLITE_FULL, /*lasting=*/false);
    absl::Status failure;
    const uint32_t acknowledged = AppendUntilFailure(&failure);
    if (vfs_.fault_count() == 0) break;
    if (!failure.ok()) {
      ++failures;
      EXPECT_THAT(failure,
                  StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("disk is full")));
      EXPECT_EQ(CheckRows(acknowledged), acknowledged);  // the failed one left nothing
      ASSERT_OK_AND_ASSIGN(const AppendOutcome outcome, AppendNext(1, acknowledged + 5));
      EXPECT_EQ(outcome.stored_rows, 5u);
      EXPECT_EQ(outcome.duplicate_rows, acknowledged);
    }
    const std::string counts = CountsText(*store_);
    store_.reset();
    ASSERT_OK_AND_ASSIGN(store_, SqliteStore::Open(options_));
    EXPECT_EQ(CountsText(*store_), counts);
    CheckRows(acknowledged);
  }
  EXPECT_GT(failures, 20);
}

TEST_F(DiskFailure, ReadsAndDeletesWhileTheDiskIsFull) {
  OpenNewStore();
  Session other = CapturingSession({"a"});
  other.id = "other";
  ASSERT_THAT(store_->CreateSession(other), IsOk());
  ASSERT_THAT(AppendNext(1, 5000), IsOk());
  const std::filesystem::path reserve = directory_->path() / "reserve";
  ASSERT_TRUE(std::filesystem::exists(reserve));
  // No file may grow beyond the space of the reserve.
  vfs_.SetGrowthAllowed([reserve] { return !std::filesystem::exists(reserve); });
  absl::Status full;
  for (uint32_t batch = 0; batch < 1000 && full.ok(); ++batch) {
    full = AppendNext(5001 + 400 * batch, 400).status();
  }
  EXPECT_THAT(full, StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_THAT(store_->GetSession("s-test"), IsOk());
  EXPECT_GE(ReadRows(*store_).size(), 5000u);

  ASSERT_THAT(store_->DeleteSession("s-test"), IsOk());
  EXPECT_THAT(store_->GetSession("s-test"), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_TRUE(std::filesystem::exists(reserve));  // filled again for the next time
  // The space of the deleted session is usable, though no file may grow.
  StreamKey stream = KeyOf("a");
  stream.session_id = "other";
  const Delivery delivery = MakeDelivery(MakeBatch(stream, 1, 100));
  absl::Status stored = store_->Append({&delivery, 1}).status();
  vfs_.SetGrowthAllowed(nullptr);
  if (!stored.ok()) stored = store_->Append({&delivery, 1}).status();
  EXPECT_THAT(stored, IsOk());
}

}  // namespace
}  // namespace rigcal::server::disk_failure_test
