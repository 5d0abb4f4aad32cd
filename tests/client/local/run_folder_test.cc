// SPDX-License-Identifier: Apache-2.0
#include "client/local/run_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::run_folder_test {
namespace {

namespace fs = std::filesystem;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(RunFolder, TemporaryOneGoesWithEverythingInIt) {
  fs::path path;
  {
    ASSERT_OK_AND_ASSIGN(const RunFolder folder, RunFolder::Create(""));
    path = folder.path();
    EXPECT_FALSE(folder.stays());
    EXPECT_TRUE(fs::is_directory(folder.Store()));
    EXPECT_TRUE(fs::is_directory(folder.Logs()));
    EXPECT_TRUE(fs::is_directory(folder.Agents()));
    fs::create_directories(folder.Store() / "deep" / "inside");
  }
  EXPECT_FALSE(fs::exists(path));
}

TEST(RunFolder, LinksAreRemovedNotFollowed) {
  const rigcal::testing::TemporaryDirectory recording;
  recording.WriteFile("left.csv", "precious");
  {
    ASSERT_OK_AND_ASSIGN(const RunFolder folder, RunFolder::Create(""));
    fs::create_directory_symlink(recording.path(), folder.path() / "recording");
  }
  EXPECT_TRUE(fs::exists(recording.path() / "left.csv"));
}

TEST(RunFolder, EachHasItsOwn) {
  ASSERT_OK_AND_ASSIGN(const RunFolder a, RunFolder::Create(""));
  ASSERT_OK_AND_ASSIGN(const RunFolder b, RunFolder::Create(""));
  EXPECT_NE(a.path(), b.path());
}

class TemporaryRuns : public ::testing::Test {
 protected:
  TemporaryRuns() { setenv("TMPDIR", directory_.path().c_str(), 1); }
  ~TemporaryRuns() override {
    if (has_before_) {
      setenv("TMPDIR", before_.c_str(), 1);
    } else {
      unsetenv("TMPDIR");
    }
  }

  const rigcal::testing::TemporaryDirectory directory_;
  const bool has_before_ = getenv("TMPDIR") != nullptr;
  const std::string before_ = has_before_ ? getenv("TMPDIR") : "";
};

TEST_F(TemporaryRuns, WhatAKilledRunLeftIsRemovedByTheNext) {
  directory_.WriteFile("rigcal-local-abcdef/lock", "");
  directory_.WriteFile("rigcal-local-abcdef/store/rigcal.db", "");
  ASSERT_THAT(RunFolder::Create(""), rigcal::testing::IsOk());
  EXPECT_TRUE(fs::is_empty(directory_.path()));
}

TEST_F(TemporaryRuns, RunsThatLiveAndFoldersOfOthersStay) {
  ASSERT_OK_AND_ASSIGN(const RunFolder alive, RunFolder::Create(""));
  // Just made, not locked yet; not ours; another thing altogether.
  directory_.WriteFile("rigcal-local-abcdef/store/rigcal.db", "");
  directory_.WriteFile("rigcal-local-abcdef-of-mine/lock", "");
  directory_.WriteFile("somebody/lock", "");
  fs::create_directory_symlink(directory_.path() / "somebody",
                               directory_.path() / "rigcal-local-ghijkl");
  { ASSERT_THAT(RunFolder::Create(""), rigcal::testing::IsOk()); }
  EXPECT_TRUE(fs::is_directory(alive.Store()));
  EXPECT_TRUE(fs::exists(directory_.path() / "rigcal-local-abcdef" / "store" / "rigcal.db"));
  EXPECT_TRUE(fs::exists(directory_.path() / "rigcal-local-abcdef-of-mine" / "lock"));
  EXPECT_TRUE(fs::exists(directory_.path() / "somebody" / "lock"));
}

TEST(RunFolder, KeptOneStays) {
  const rigcal::testing::TemporaryDirectory directory;
  const fs::path keep = directory.path() / "new" / "keep me";
  {
    ASSERT_OK_AND_ASSIGN(const RunFolder folder, RunFolder::Create(keep));
    EXPECT_TRUE(folder.stays());
  }
  EXPECT_TRUE(fs::is_directory(keep / "store"));
}

TEST(RunFolder, RunsAreNotMixed) {
  const rigcal::testing::TemporaryDirectory directory;
  directory.WriteFile("earlier.txt", "");
  EXPECT_THAT(RunFolder::Create(directory.path()),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr(directory.path().string()), HasSubstr("not empty"))));
}

TEST(RunFolder, NamesAFolderThatCannotBeMade) {
  const rigcal::testing::TemporaryDirectory directory;
  const fs::path file = directory.WriteFile("file", "");
  EXPECT_THAT(RunFolder::Create(file / "below"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("below")));
}

}  // namespace
}  // namespace rigcal::client::run_folder_test
