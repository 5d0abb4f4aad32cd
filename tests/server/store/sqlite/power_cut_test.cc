// SPDX-License-Identifier: Apache-2.0
// The power fails at every write and every sync: what was acknowledged is there afterwards,
// whatever part of the unsynced writes has reached the disk.

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cstdlib>
#include <filesystem>
#include <memory>

#include "tests/server/store/sqlite/faulty_vfs.h"
#include "tests/server/store/sqlite/store_work.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::power_cut_test {
namespace {

using ::rigcal::testing::Acknowledged;
using ::rigcal::testing::ExpectAcknowledged;
using ::rigcal::testing::FaultyVfs;
using ::rigcal::testing::StoreWork;
using ::rigcal::testing::TemporaryDirectory;
using ::rigcal::testing::UnsyncedFiles;

class PowerCut : public ::testing::Test {
 protected:
  void SetUp() override {
    vfs_.Heal();
    vfs_.SetModel(&model_);
  }
  void TearDown() override {
    vfs_.Heal();
    vfs_.SetModel(nullptr);
  }

  // Works until the power fails at the `operation`th operation; false: the work ended before.
  bool PowerFails(int64_t operation, double kept, uint32_t seed) {
    const TemporaryDirectory directory;
    model_.Forget();
    const SqliteStoreOptions options{.data_directory = directory.path(),
                                     .reserve_bytes = 0,
                                     .checkpoint_bytes = 64u << 10,
                                     .vfs = vfs_.name()};
    vfs_.FailAt(operation, SQLITE_IOERR_WRITE, /*lasting=*/true);
    Acknowledged done;
    if (const auto store = SqliteStore::Open(options); store.ok()) {
      StoreWork work(store->get());
      work.Run();
      done = work.done();
    }
    const bool failed = vfs_.fault_count() > 0;
    vfs_.Heal();
    model_.CutPower(kept, seed);
    // The index of the log is memory, and gone.
    std::filesystem::remove(directory.path() / "rigcal.db-shm");
    if (failed) ExpectAcknowledged(options, done);
    return failed;
  }

  FaultyVfs& vfs_ = FaultyVfs::Get();
  UnsyncedFiles model_;
};

TEST_F(PowerCut, KeepsWhatWasAcknowledgedWhereNothingUnsyncedReachedTheDisk) {
  int64_t operation = 1;
  for (bool failed = true; failed && !HasFailure(); ++operation) {
    SCOPED_TRACE(::testing::Message() << "operation " << operation);
    failed = PowerFails(operation, 0, 1);
  }
  EXPECT_GT(operation, 100);
}

TEST_F(PowerCut, KeepsWhatWasAcknowledgedWherePartsOfItReachedTheDisk) {
  // RIGCAL_POWER_CUT_SEEDS: how many different parts, for each operation.
  const char* asked = std::getenv("RIGCAL_POWER_CUT_SEEDS");
  const auto seeds = static_cast<uint32_t>(asked == nullptr ? 1 : std::atoi(asked));
  for (uint32_t seed = 1; seed <= seeds; ++seed) {
    bool failed = true;
    for (uint32_t operation = 1; failed && !HasFailure(); ++operation) {
      SCOPED_TRACE(::testing::Message() << "operation " << operation << ", seed " << seed);
      failed = PowerFails(operation, 0.25 * (1 + (operation + seed) % 3), 1000 * seed + operation);
    }
  }
}

// The model is no proof if it keeps everything: a store that does not sync loses rows in it.
TEST_F(PowerCut, TheModelDropsWhatWasNotSynced) {
  UnsyncedFiles model;
  const TemporaryDirectory directory;
  const std::string path = (directory.path() / "file").string();
  model.NoteWrite(path, "synced", 0);
  model.NoteSync(path);
  model.NoteWrite(path, "UNSYNCED", 4);
  model.CutPower(0, 1);
  EXPECT_EQ(std::filesystem::file_size(path), 6u);
  model.NoteWrite(path, "never synced", 0);
  model.CutPower(0, 1);
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace rigcal::server::power_cut_test
