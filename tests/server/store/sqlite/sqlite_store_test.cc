// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/sqlite_store.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "server/store/sqlite/sqlite_schema.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::sqlite_store_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::AllOf;
using ::testing::HasSubstr;

class SqliteStoreTest : public ::rigcal::testing::StoreFixture {
 protected:
  SqliteStoreOptions Options() const { return {.data_directory = folder()}; }
  std::filesystem::path File() const { return folder() / "rigcal.db"; }
  // With the store closed.
  int Execute(const std::string& sql) {
    SQLite::Database database(File().string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    return database.exec(sql);
  }
};

TEST_F(SqliteStoreTest, KeepsItsIdentity) {
  const std::string id = store().server_id();
  EXPECT_EQ(id.size(), 32u);
  Reopen();
  EXPECT_EQ(store().server_id(), id);
  SqliteStoreOptions other = Options();
  other.data_directory = directory_.path() / "other";
  ASSERT_OK_AND_ASSIGN(const auto second, SqliteStore::Open(other));
  EXPECT_NE(second->server_id(), id);
}

TEST_F(SqliteStoreTest, ReportsItsHealth) {
  const StoreHealth health = store().Health();
  EXPECT_EQ(health.kind, "sqlite");
  EXPECT_EQ(health.schema_version, kSchemaVersion);
  EXPECT_GT(health.size_bytes, 0u);
  EXPECT_GT(health.free_bytes, 0u);
}

TEST_F(SqliteStoreTest, RefusesADirectoryThatIsInUse) {
  const std::string directory = Options().data_directory.string();
  EXPECT_THAT(SqliteStore::Open(Options()),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr(directory), HasSubstr(std::to_string(getpid())))));
  Close();
  EXPECT_THAT(SqliteStore::Open(Options()), IsOk());
}

TEST_F(SqliteStoreTest, RefusesAnotherSchemaAndLeavesItAlone) {
  const std::string id = store().server_id();
  Close();
  for (const uint32_t version : {kSchemaVersion + 1, 2u}) {
    Execute("PRAGMA user_version=" + std::to_string(version));
    const std::string words = "schema version " + std::to_string(version);
    EXPECT_THAT(SqliteStore::Open(Options()),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr(words), HasSubstr(File().string()),
                               HasSubstr("another --data-dir"))));
  }
  Execute("PRAGMA user_version=" + std::to_string(kSchemaVersion));
  ASSERT_OK_AND_ASSIGN(const auto again, SqliteStore::Open(Options()));
  EXPECT_EQ(again->server_id(), id);
}

TEST_F(SqliteStoreTest, RefusesADatabaseOfAnotherProgram) {
  Close();
  std::filesystem::remove(File());
  Execute("CREATE TABLE diary(entry TEXT)");
  EXPECT_THAT(SqliteStore::Open(Options()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("another program")));
}

TEST_F(SqliteStoreTest, RefusesAFileThatIsNoDatabase) {
  Close();
  std::filesystem::remove(File());
  directory_.WriteFile("data/rigcal.db", std::string(8192, 'x'));
  EXPECT_THAT(SqliteStore::Open(Options()),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("restore a backup")));
}

TEST_F(SqliteStoreTest, RefusesADirectoryThatCannotBe) {
  SqliteStoreOptions options = Options();
  options.data_directory = directory_.WriteFile("file", "text") / "data";
  EXPECT_THAT(SqliteStore::Open(options),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("file/data")));
  options.data_directory.clear();
  EXPECT_THAT(SqliteStore::Open(options), StatusIs(absl::StatusCode::kInvalidArgument, _));
}

}  // namespace
}  // namespace rigcal::server::sqlite_store_test
