// SPDX-License-Identifier: Apache-2.0
// check, backup and compact while a store is open; restore.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>

#include "server/store/sqlite/database_backup.h"
#include "server/store/sqlite/database_check.h"
#include "server/store/sqlite/sqlite_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::database_care_test {
namespace {

namespace fs = std::filesystem;

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::CountsText;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const CareProgress kNoProgress = [](double) {};

std::string Text(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class DatabaseCare : public ::rigcal::testing::StoreFixture {
 protected:
  void SetUp() override {
    StoreFixture::SetUp();
    ASSERT_THAT(store().CreateSession(CapturingSession({"a", "b"})), IsOk());
    Append(MakeBatch(KeyOf("a"), 1, 100));
    Append(MakeBatch(KeyOf("b"), 1, 50));
  }
  fs::path File() const { return folder() / "rigcal.db"; }
  fs::path Backup() const { return directory_.path() / "backup.rigcal"; }
  // With the store closed.
  int Execute(const std::string& sql) {
    SQLite::Database database(File().string(), SQLite::OPEN_READWRITE);
    return database.exec(sql);
  }
  void ExpectFault(const std::string& sql, const std::string& words) {
    Close();
    ASSERT_GE(Execute(sql), 1) << sql;
    ASSERT_OK_AND_ASSIGN(const DatabaseReport report, CheckDatabase(File(), kNoProgress));
    EXPECT_GE(report.fault_count, 1u) << sql;
    EXPECT_THAT(report.faults, ::testing::Contains(HasSubstr(words))) << sql;
  }
};

TEST_F(DatabaseCare, CheckOfAnOpenStoreFindsNothingWrong) {
  Calibration calibration;
  calibration.rig = "rig";
  ASSERT_THAT(store().CreateCalibration(calibration), IsOk());
  double last = 0;
  ASSERT_OK_AND_ASSIGN(const DatabaseReport report,
                       CheckDatabase(File(), [&](double part) { last = part; }));
  EXPECT_THAT(report.faults, ElementsAre());
  EXPECT_EQ(report.session_count, 1u);
  EXPECT_EQ(report.calibration_count, 1u);
  EXPECT_EQ(report.batch_count, 2u);
  EXPECT_EQ(report.observation_count, 150u);
  EXPECT_EQ(last, 1);
}

TEST_F(DatabaseCare, CheckSeesOneStateWhileRowsArrive) {
  std::atomic<bool> stop = false;
  std::thread writer([&] {
    for (uint32_t seq = 101; !stop; seq += 10) Append(MakeBatch(KeyOf("a"), seq, seq + 9));
  });
  for (int i = 0; i < 20 && !HasFailure(); ++i) {
    ASSERT_OK_AND_ASSIGN(const DatabaseReport report, CheckDatabase(File(), kNoProgress));
    EXPECT_THAT(report.faults, ElementsAre());
  }
  stop = true;
  writer.join();
}

TEST_F(DatabaseCare, CheckNamesEverySumThatIsWrong) {
  ExpectFault("UPDATE session_camera SET observation_count=99 WHERE camera='a'",
              "session s-test, camera a: 100 observations are stored, and 99 are counted");
  ExpectFault("UPDATE session_camera SET wand_count=1 WHERE camera='b'", "wands are stored");
  ExpectFault("UPDATE stream SET durable_seq=90 WHERE id=1", "stored up to seq 100");
  ExpectFault("UPDATE batch SET row_count=49 WHERE row_count=50", "49 are noted");
  ExpectFault("UPDATE batch SET body=substr(body,1,99)||x'00'||substr(body,101)", "checksum");
  ExpectFault("UPDATE session SET checksum=1", "record of session s-test");
  ExpectFault("UPDATE session_summary SET checksum=1", "summary of session s-test");
}

TEST_F(DatabaseCare, CheckRefusesWhatIsNoDatabaseOfThisVersion) {
  Close();
  EXPECT_THAT(CheckDatabase(folder() / "none.db", kNoProgress),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none.db")));
  Execute("PRAGMA user_version=2");
  EXPECT_THAT(CheckDatabase(File(), kNoProgress),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("version 2")));
  directory_.WriteFile("text.db", std::string(5000, 'x'));
  EXPECT_THAT(CheckDatabase(directory_.path() / "text.db", kNoProgress),
              StatusIs(absl::StatusCode::kDataLoss, _));
}

TEST_F(DatabaseCare, BackupWhileRowsArriveIsOneState) {
  std::atomic<bool> stop = false;
  std::thread writer([&] {
    for (uint32_t seq = 101; !stop; seq += 10) Append(MakeBatch(KeyOf("a"), seq, seq + 9));
  });
  const auto report = BackUpDatabase(folder(), Backup(), kNoProgress);
  stop = true;
  writer.join();
  ASSERT_THAT(report, IsOk());
  EXPECT_THAT(report->faults, ElementsAre());
  EXPECT_GE(report->observation_count, 150u);
  struct stat entry = {};
  ASSERT_EQ(stat(Backup().c_str(), &entry), 0);
  EXPECT_EQ(entry.st_mode & 0777, 0600u);
  EXPECT_FALSE(fs::exists(Backup().string() + "-wal"));
  EXPECT_THAT(BackUpDatabase(folder(), Backup(), kNoProgress),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("backup.rigcal")));
  EXPECT_THAT(BackUpDatabase(directory_.path() / "nothing", directory_.path() / "x", kNoProgress),
              StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(BackUpDatabase(folder(), directory_.path() / "no" / "x", kNoProgress),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no/x")));
}

// What would run with the server's rights when the data is used.
TEST_F(DatabaseCare, NothingInABackupRuns) {
  for (const char* sql : {
           "CREATE TRIGGER t AFTER DELETE ON backup_file BEGIN UPDATE session SET rig='x'; END",
           "CREATE TRIGGER t AFTER INSERT ON counter BEGIN DELETE FROM batch; END",
           "CREATE VIEW t AS SELECT 1",
           "CREATE TABLE t(x)",
           "CREATE VIRTUAL TABLE t USING fts5(x)",
           "CREATE INDEX t ON session(abs(state))",
           "DROP TABLE backup_file; CREATE VIEW backup_file AS SELECT 'a' AS path, 'b' AS body, 1 "
           "AS checksum",
           "DROP TABLE counter; CREATE TABLE counter(name TEXT PRIMARY KEY, value INTEGER NOT NULL "
           "DEFAULT (abs(1))) WITHOUT ROWID",
       }) {
    SCOPED_TRACE(sql);
    fs::remove(Backup());
    ASSERT_THAT(BackUpDatabase(folder(), Backup(), kNoProgress), IsOk());
    Close();
    {
      SQLite::Database database(Backup().string(), SQLite::OPEN_READWRITE);
      database.exec(sql);
    }
    const auto refused =
        StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("which rigcal has not made"));
    EXPECT_THAT(RestoreDatabase(Backup(), folder(), {}, kNoProgress), refused);
    EXPECT_THAT(RestoreDatabase(Backup(), folder(), {.take_damaged = true}, kNoProgress), refused);
    EXPECT_THAT(CheckDatabase(Backup(), kNoProgress), refused);
    // Nor when it is put in place by hand.
    const fs::path by_hand = directory_.path() / "by_hand";
    fs::create_directory(by_hand);
    fs::rename(Backup(), by_hand / "rigcal.db");
    EXPECT_THAT(SqliteStore::Open({.data_directory = by_hand}), refused);
    EXPECT_THAT(BackUpDatabase(by_hand, Backup(), kNoProgress), refused);
    fs::remove_all(by_hand);
    Open();
  }
  EXPECT_EQ(ReadRows(store()).size(), 150u) << "the data is untouched";
  Close();
  Execute("ANALYZE");
  Open();
}

TEST_F(DatabaseCare, RestorePutsEverythingBackAndKeepsWhatWas) {
  fs::create_directory(folder() / "identity");
  directory_.WriteFile("data/identity/ca.key", "secret");
  directory_.WriteFile("data/audit.jsonl", "{}\n");
  const auto rows = ReadRows(store());
  const std::string counts = CountsText(store());
  const std::string id = store().server_id();
  ASSERT_THAT(BackUpDatabase(folder(), Backup(), kNoProgress), IsOk());
  Append(MakeBatch(KeyOf("a"), 101, 200));

  EXPECT_THAT(RestoreDatabase(Backup(), folder(), {}, kNoProgress),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("another server")));
  Close();
  directory_.WriteFile("data/identity/ca.key", "another");
  ASSERT_OK_AND_ASSIGN(const RestoreReport report,
                       RestoreDatabase(Backup(), folder(), {}, kNoProgress));
  EXPECT_EQ(report.backup.observation_count, 150u);
  EXPECT_TRUE(fs::exists(report.kept / "rigcal.db")) << report.kept;
  EXPECT_EQ(Text(report.kept / "identity" / "ca.key"), "another");
  EXPECT_EQ(Text(folder() / "identity" / "ca.key"), "secret");
  EXPECT_EQ(Text(folder() / "audit.jsonl"), "{}\n");
  struct stat entry = {};
  ASSERT_EQ(stat((folder() / "identity" / "ca.key").c_str(), &entry), 0);
  EXPECT_EQ(entry.st_mode & 0777, 0600u);
  ASSERT_EQ(stat((folder() / "identity").c_str(), &entry), 0);
  EXPECT_EQ(entry.st_mode & 0777, 0700u);
  Open();
  EXPECT_EQ(store().server_id(), id);
  EXPECT_EQ(CountsText(store()), counts);
  EXPECT_TRUE(ReadRows(store()) == rows);
  EXPECT_EQ(Append(MakeBatch(KeyOf("a"), 101, 110)).stored_rows, 10u);
  Close();
  SQLite::Database database(File().string(), SQLite::OPEN_READONLY);
  EXPECT_FALSE(database.tableExists("backup_file"));
}

// A backup of the database by hand: the keys are those of the folder before, closed to others.
TEST_F(DatabaseCare, WhatABackupLacksIsTakenAndClosedToOthers) {
  fs::create_directory(folder() / "identity");
  directory_.WriteFile("data/identity/ca.key", "secret");
  directory_.WriteFile("data/agents.json", "{}");
  Close();
  fs::copy_file(File(), Backup());
  chmod((folder() / "identity").c_str(), 0755);
  chmod((folder() / "identity" / "ca.key").c_str(), 0644);
  chmod((folder() / "agents.json").c_str(), 0666);
  fs::path before, after;
  const auto look = [&](const fs::path& old_folder, const fs::path& new_folder) {
    before = old_folder;
    after = new_folder;
    return fs::exists(new_folder / "identity" / "ca.key") ? absl::OkStatus()
                                                          : absl::InternalError("too early");
  };
  ASSERT_THAT(RestoreDatabase(Backup(), folder(), {.reconcile = look}, kNoProgress), IsOk());
  EXPECT_EQ(before, folder());
  EXPECT_FALSE(fs::exists(after)) << "it has taken its place";
  for (const auto& [name, mode] : {std::pair{"identity", 0700u},
                                   {"identity/ca.key", 0600u},
                                   {"agents.json", 0600u},
                                   {"rigcal.db", 0600u}}) {
    struct stat entry = {};
    ASSERT_EQ(stat((folder() / name).c_str(), &entry), 0) << name;
    EXPECT_EQ(entry.st_mode & 0777, mode) << name;
  }
  const auto refuse = [](const fs::path&, const fs::path&) { return absl::AbortedError("no"); };
  EXPECT_THAT(RestoreDatabase(Backup(), folder(), {.reconcile = refuse}, kNoProgress),
              StatusIs(absl::StatusCode::kAborted, HasSubstr("no")));
  Open();
  EXPECT_EQ(ReadRows(store()).size(), 150u) << "nothing was moved";
}

TEST_F(DatabaseCare, RestoreIntoAFolderThatIsNotThere) {
  ASSERT_THAT(BackUpDatabase(folder(), Backup(), kNoProgress), IsOk());
  const fs::path other = directory_.path() / "other";
  ASSERT_OK_AND_ASSIGN(const RestoreReport report,
                       RestoreDatabase(Backup(), other, {}, kNoProgress));
  EXPECT_EQ(report.kept, "");
  ASSERT_OK_AND_ASSIGN(const auto restored, SqliteStore::Open({.data_directory = other}));
  EXPECT_EQ(ReadRows(*restored).size(), 150u);
}

TEST_F(DatabaseCare, RestoreRefusesADamagedBackupUnlessToldOtherwise) {
  Close();
  Execute("UPDATE batch SET body=substr(body,1,99)||x'00'||substr(body,101) WHERE row_count=50");
  ASSERT_OK_AND_ASSIGN(const DatabaseReport backup,
                       BackUpDatabase(folder(), Backup(), kNoProgress));
  EXPECT_EQ(backup.damaged_row_count, 50u);
  EXPECT_THAT(
      RestoreDatabase(Backup(), folder(), {}, kNoProgress),
      StatusIs(absl::StatusCode::kDataLoss, AllOf(HasSubstr("camera b"), HasSubstr("--damaged"))));
  EXPECT_THAT(RestoreDatabase(Backup(), folder(), {.take_damaged = true}, kNoProgress), IsOk());
  Open();
  EXPECT_EQ(ReadRows(store()).size(), 100u);
  // A server runs on this folder: that is said first.
  EXPECT_THAT(RestoreDatabase(Backup(), folder(), {}, kNoProgress),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("in use")));
  Close();
  EXPECT_THAT(RestoreDatabase(directory_.path() / "none", folder(), {}, kNoProgress),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none")));
}

TEST_F(DatabaseCare, CompactGivesTheSpaceBackWhileRowsArrive) {
  Session other = CapturingSession({"a"});
  other.id = "other";
  ASSERT_THAT(store().CreateSession(other), IsOk());
  StreamKey stream = KeyOf("a");
  stream.session_id = "other";
  for (uint32_t i = 0; i < 40; ++i) Append(MakeBatch(stream, 1 + 500 * i, 500 * (i + 1)));
  ASSERT_THAT(store().DeleteSession("other"), IsOk());
  EXPECT_GT(store().Health().unused_bytes, 1'000'000u);
  std::atomic<bool> stop = false;
  uint32_t last = 100;
  std::thread writer([&] {
    for (; !stop; last += 10) Append(MakeBatch(KeyOf("a"), last + 1, last + 10));
  });
  double part = -1;
  const auto watch = [&](double now) {
    EXPECT_GE(now, part);
    part = now;
    return absl::OkStatus();
  };
  const absl::Status compacted = store().Compact(watch);
  stop = true;
  writer.join();
  ASSERT_THAT(compacted, IsOk());
  EXPECT_EQ(part, 1);
  EXPECT_LT(store().Health().unused_bytes, 200'000u);
  EXPECT_EQ(ReadRows(store()).size(), 50 + last);
  Close();
  EXPECT_LT(fs::file_size(File()), 2'000'000u);
  ASSERT_OK_AND_ASSIGN(const DatabaseReport report, CheckDatabase(File(), kNoProgress));
  EXPECT_THAT(report.faults, ElementsAre());
}

// Else what the log holds would come on top of what the database has given back.
TEST_F(DatabaseCare, CompactEmptiesTheLog) {
  const fs::path log = File().string() + "-wal";
  EXPECT_GT(fs::file_size(log), 0u);
  const auto go_on = [](double) { return absl::OkStatus(); };
  {
    SQLite::Database reader(File().string(), SQLite::OPEN_READONLY);
    reader.exec("BEGIN");
    reader.execAndGet("SELECT count(*) FROM batch");
    Append(MakeBatch(KeyOf("a"), 101, 200));
    EXPECT_THAT(store().Compact(go_on), IsOk()) << "a reader keeps the log";
    EXPECT_GT(fs::file_size(log), 0u);
  }
  EXPECT_THAT(store().Compact(go_on), IsOk());
  EXPECT_EQ(fs::file_size(log), 0u);
}

TEST_F(DatabaseCare, CompactEndsWhenItIsTold) {
  EXPECT_THAT(store().Compact([](double) { return absl::CancelledError("gone"); }),
              StatusIs(absl::StatusCode::kCancelled, _));
}

}  // namespace
}  // namespace rigcal::server::database_care_test
