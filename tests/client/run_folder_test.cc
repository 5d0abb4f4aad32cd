// SPDX-License-Identifier: Apache-2.0
#include "client/run_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client {
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
}  // namespace rigcal::client
