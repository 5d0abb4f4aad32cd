// SPDX-License-Identifier: Apache-2.0
#include "server/store/data_directory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "server/store/sqlite/sqlite_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::data_directory_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

unsigned ModeOf(const std::filesystem::path& path) {
  struct stat entry = {};
  EXPECT_EQ(stat(path.c_str(), &entry), 0) << path;
  return entry.st_mode & 0777;
}

class DataDirectoryTest : public ::testing::Test {
 protected:
  std::filesystem::path Folder() const { return directory_.path() / "data"; }
  SqliteStoreOptions Options() const {
    return {.data_directory = Folder(), .reserve_bytes = 1u << 20};
  }
  TemporaryDirectory directory_;
};

TEST_F(DataDirectoryTest, IsTakenOnceAlsoWithoutItsLockFile) {
  ASSERT_OK_AND_ASSIGN(auto first, DataDirectory::Open(Folder()));
  EXPECT_THAT(DataDirectory::Open(Folder()),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr(Folder().string()), HasSubstr(std::to_string(getpid())))));
  std::filesystem::remove(Folder() / "lock");
  EXPECT_THAT(DataDirectory::Open(Folder()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("`lock` is gone")));
  EXPECT_FALSE(std::filesystem::exists(Folder() / "lock"));
  first.reset();
  EXPECT_THAT(DataDirectory::Open(Folder()), IsOk());
}

TEST_F(DataDirectoryTest, ASecondServerIsRefusedWhenTheLockFileIsDeleted) {
  ASSERT_OK_AND_ASSIGN(const auto first, SqliteStore::Open(Options()));
  ASSERT_THAT(first->CreateSession(CapturingSession({"a"})), IsOk());
  std::filesystem::remove(Folder() / "lock");
  EXPECT_THAT(SqliteStore::Open(Options()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("another server")));
  EXPECT_THAT(first->GetSession("s-test"), IsOk());
}

TEST_F(DataDirectoryTest, IsForItsUserOnly) {
  const mode_t mask = umask(0);
  ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(Options()));
  ASSERT_THAT(store->CreateSession(CapturingSession({"a"})), IsOk());
  umask(mask);
  EXPECT_EQ(ModeOf(Folder()), 0700u);
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(Folder())) {
    EXPECT_EQ(ModeOf(entry.path()), 0600u) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 5);  // database, log, its index, lock, reserve
}

TEST_F(DataDirectoryTest, FoldersOfEarlierReleasesAreClosedToOthers) {
  { ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(Options())); }
  chmod(Folder().c_str(), 0755);
  for (const char* file : {"rigcal.db", "lock", "reserve"}) {
    chmod((Folder() / file).c_str(), 0644);
  }
  directory_.WriteFile("data/of_somebody_else", "x");
  chmod((Folder() / "of_somebody_else").c_str(), 0644);
  ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(Options()));
  EXPECT_EQ(ModeOf(Folder()), 0700u);
  for (const char* file : {"rigcal.db", "lock", "reserve"}) {
    EXPECT_EQ(ModeOf(Folder() / file), 0600u) << file;
  }
  EXPECT_EQ(ModeOf(Folder() / "of_somebody_else"), 0644u);
}

// A folder that another user has prepared: the server must not write where his links lead.
TEST_F(DataDirectoryTest, LinksAreNotFollowed) {
  for (const char* name : {"lock", "rigcal.db", "reserve"}) {
    SCOPED_TRACE(name);
    std::filesystem::remove_all(Folder());
    std::filesystem::create_directory(Folder());
    const std::filesystem::path target = directory_.WriteFile("target", "untouched");
    std::filesystem::create_symlink(target, Folder() / name);
    auto opened = SqliteStore::Open(Options());
    if (name != std::string("reserve")) {
      EXPECT_THAT(opened,
                  StatusIs(absl::StatusCode::kFailedPrecondition,
                           AllOf(HasSubstr((Folder() / name).string()), HasSubstr("link"))));
    } else {
      EXPECT_THAT(opened, IsOk()) << "a server can do without a reserve";
    }
    EXPECT_EQ(std::filesystem::file_size(target), 9u);
    opened = absl::UnknownError("closed");
    std::filesystem::remove(target);
    std::filesystem::remove(Folder() / name);
    std::filesystem::create_symlink(target, Folder() / name);
    EXPECT_EQ(SqliteStore::Open(Options()).ok(), name == std::string("reserve"));
    EXPECT_FALSE(std::filesystem::exists(target)) << "nor made";
  }
}

TEST_F(DataDirectoryTest, WhatBelongsToAnotherUserIsRefusedAndNamed) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can give files away";
  constexpr uid_t kSomebody = 54321;
  { ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(Options())); }
  std::filesystem::create_directory(Folder() / "identity");
  for (const char* name : {"", "rigcal.db", "lock", "agents.json", "identity"}) {
    const std::filesystem::path path = *name == '\0' ? Folder() : Folder() / name;
    if (!std::filesystem::exists(path)) directory_.WriteFile("data/" + std::string(name), "{}");
    ASSERT_EQ(lchown(path.c_str(), kSomebody, kSomebody), 0);
    EXPECT_THAT(SqliteStore::Open(Options()),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr(path.string()), HasSubstr("54321"), HasSubstr("chown"))));
    ASSERT_EQ(lchown(path.c_str(), 0, 0), 0);
  }
  EXPECT_THAT(SqliteStore::Open(Options()), IsOk());
}

TEST_F(DataDirectoryTest, KeysOfEarlierReleasesAreClosedToOthers) {
  { ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(Options())); }
  std::filesystem::create_directories(Folder() / "identity" / ".active");
  for (const char* name : {"identity/ca.key", "identity/.active/server.key", "agents.json"}) {
    directory_.WriteFile("data/" + std::string(name), "secret");
    chmod((Folder() / name).c_str(), 0644);
  }
  chmod((Folder() / "identity").c_str(), 0755);
  directory_.WriteFile("data/agents.json.12-3.new", "of a start that was killed");
  ASSERT_OK_AND_ASSIGN(const auto store, SqliteStore::Open(Options()));
  for (const char* name : {"identity/ca.key", "identity/.active/server.key", "agents.json"}) {
    EXPECT_EQ(ModeOf(Folder() / name), 0600u) << name;
  }
  EXPECT_EQ(ModeOf(Folder() / "identity"), 0700u);
  EXPECT_FALSE(std::filesystem::exists(Folder() / "agents.json.12-3.new"));
}

TEST_F(DataDirectoryTest, AFolderThatEverybodySharesStaysOpen) {
  std::filesystem::create_directory(Folder());
  chmod(Folder().c_str(), 01777);
  ASSERT_OK_AND_ASSIGN(const auto directory, DataDirectory::Open(Folder()));
  EXPECT_EQ(ModeOf(Folder()), 0777u);
}

// Observations stop before the disk is full, so that everything else goes on.
TEST_F(DataDirectoryTest, ObservationsAreRefusedBeforeTheDiskIsFull) {
  SqliteStoreOptions options = Options();
  ASSERT_OK_AND_ASSIGN(auto store, SqliteStore::Open(options));
  const uint64_t free_bytes = store->Health().free_bytes;
  store.reset();
  options.min_free_bytes = free_bytes + (uint64_t{1} << 40);
  ASSERT_OK_AND_ASSIGN(store, SqliteStore::Open(options));
  EXPECT_EQ(store->Health().reserve_bytes, options.min_free_bytes);
  ASSERT_THAT(store->CreateSession(CapturingSession({"a"})), IsOk());
  const Delivery delivery = testing::MakeDelivery(testing::MakeBatch(testing::KeyOf("a"), 1, 10));
  EXPECT_THAT(store->Append({&delivery, 1}),
              StatusIs(absl::StatusCode::kResourceExhausted,
                       AllOf(HasSubstr(Folder().string()), HasSubstr("limits.disk_reserve_mb"))));
  EXPECT_THAT(store->UpdateSession(CapturingSession({"a"})), IsOk());
  EXPECT_THAT(store->DeleteSession("s-test"), IsOk());
}

}  // namespace
}  // namespace rigcal::server::data_directory_test
