// SPDX-License-Identifier: Apache-2.0
// The k-th call to the disk fails, for all k and every kind of write: no crash, nothing
// acknowledged is lost, the store says what is wrong, and after a failed write or sync it stops.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "tests/server/store/sqlite/faulty_vfs.h"
#include "tests/server/store/sqlite/store_work.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::io_error_test {
namespace {

using ::rigcal::testing::Acknowledged;
using ::rigcal::testing::ExpectAcknowledged;
using ::rigcal::testing::FaultyVfs;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::StoreWork;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::_;
using ::testing::HasSubstr;

class IoError : public ::testing::Test {
 protected:
  void SetUp() override { vfs_.Heal(); }
  void TearDown() override { vfs_.Heal(); }

  // Works with one failure of `code` at the `operation`th operation. `look` gets the store and the
  // failure of the work, OK where it noticed none. False: the work ended before.
  template <typename Look>
  bool Fails(int64_t operation, int code, bool reads, const Look& look) {
    const TemporaryDirectory directory;
    const SqliteStoreOptions options{.data_directory = directory.path(),
                                     .reserve_bytes = 0,
                                     .checkpoint_bytes = 64u << 10,
                                     .vfs = vfs_.name()};
    vfs_.SetReadsFail(reads);
    vfs_.FailAt(operation, code, /*lasting=*/false);
    if (code != SQLITE_FULL) vfs_.SetSyncCode(SQLITE_IOERR_FSYNC);
    Acknowledged done;
    bool failed = false;
    {
      const auto store = SqliteStore::Open(options);
      // SQLite can do without some calls while it makes a new database.
      const bool while_opening = vfs_.fault_count() > 0;
      if (store.ok()) {
        StoreWork work(store->get());
        work.Run();
        failed = vfs_.fault_count() > 0;
        if (failed && !while_opening) look(&work, store->get());
        done = work.done();
      }
      failed = failed || while_opening;
    }
    vfs_.Heal();
    if (failed) ExpectAcknowledged(options, done);
    return failed;
  }

  FaultyVfs& vfs_ = FaultyVfs::Get();
};

TEST_F(IoError, AFailedWriteOrSyncStopsTheStoreWhichSaysSo) {
  int stopped = 0;
  bool failed = true;
  for (int64_t operation = 1; failed && !HasFailure(); ++operation) {
    SCOPED_TRACE(::testing::Message() << "operation " << operation);
    failed = Fails(operation, SQLITE_IOERR_WRITE, false, [&](StoreWork* work, Store* store) {
      ++stopped;
      // Where it hit a checkpoint, the next write says so.
      if (work->failure().ok()) work->Append();
      EXPECT_THAT(work->failure(), StatusIs(absl::StatusCode::kInternal, _));
      EXPECT_THAT(store->Health().problem, HasSubstr("restart the server"));
      EXPECT_FALSE(work->Append()) << "it goes on after a failed sync";
      EXPECT_THAT(store->ListSessions({}, {.limit = 5}), IsOk());
    });
  }
  EXPECT_GT(stopped, 100);
}

TEST_F(IoError, AFullDiskStopsNothing) {
  int full = 0;
  bool failed = true;
  for (int64_t operation = 1; failed && !HasFailure(); ++operation) {
    SCOPED_TRACE(::testing::Message() << "operation " << operation);
    failed = Fails(operation, SQLITE_FULL, false, [&](StoreWork* work, Store* store) {
      EXPECT_EQ(store->Health().problem, "");
      if (work->failure().ok()) return;
      ++full;
      EXPECT_THAT(work->failure(), StatusIs(absl::StatusCode::kResourceExhausted, _));
      if (work->done().session) {
        EXPECT_TRUE(work->Append()) << work->failure();
      }
    });
  }
  EXPECT_GT(full, 40);
}

TEST_F(IoError, AFailedReadIsAnErrorAndNoCrash) {
  bool failed = true;
  for (int64_t operation = 1; failed && !HasFailure(); ++operation) {
    SCOPED_TRACE(::testing::Message() << "operation " << operation);
    failed = Fails(operation, SQLITE_IOERR_READ, true, [](StoreWork*, Store*) {});
  }
}

TEST_F(IoError, AFailedReadShowsInTheHealth) {
  const TemporaryDirectory directory;
  const SqliteStoreOptions options{
      .data_directory = directory.path(), .reserve_bytes = 0, .vfs = vfs_.name()};
  {
    ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(options));
    StoreWork(store.get()).Run();
  }
  ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(options));
  EXPECT_EQ(store->Health().read_problem, "");
  vfs_.SetReadsFail(true);
  vfs_.FailAt(1, SQLITE_IOERR_READ, /*lasting=*/true);
  EXPECT_THAT(store->ListSessions({}, {.limit = 5}), StatusIs(absl::StatusCode::kInternal, _));
  vfs_.Heal();
  // Also when the next read finds what it needs in memory.
  EXPECT_THAT(store->ListSessions({}, {.limit = 5}), IsOk());
  EXPECT_THAT(store->Health().read_problem, HasSubstr("cannot be read"));
  EXPECT_EQ(store->Health().problem, "") << "what is written is safe";
}

}  // namespace
}  // namespace rigcal::server::io_error_test
