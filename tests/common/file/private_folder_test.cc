// SPDX-License-Identifier: Apache-2.0
#include "common/file/private_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::private_folder_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr uid_t kSomebody = 54321;

class PrivateFolderTest : public ::testing::Test {
 protected:
  fs::path Path(std::string_view name) const { return directory_.path() / name; }
  unsigned ModeOf(const fs::path& path) const {
    struct stat about = {};
    EXPECT_EQ(stat(path.c_str(), &about), 0) << path;
    return about.st_mode & 07777;
  }
  // False: only root can do that.
  bool GiveAway(const fs::path& path) const {
    return geteuid() == 0 && lchown(path.c_str(), kSomebody, kSomebody) == 0;
  }

  const TemporaryDirectory directory_;
};

TEST_F(PrivateFolderTest, IsMadeAndClosedToOthersWhateverTheUmask) {
  for (const mode_t mask : {0000, 0022, 0077}) {
    const mode_t before = umask(mask);
    const absl::Status made = MakePrivateFolder(Path("deep") / "folder/");
    const absl::StatusOr<FileDescriptor> file = OpenPrivateFile(Path("deep/folder/lock"));
    umask(before);
    ASSERT_THAT(made, IsOk());
    ASSERT_THAT(file, IsOk());
    EXPECT_EQ(ModeOf(Path("deep/folder")), 0700u);
    EXPECT_EQ(ModeOf(Path("deep/folder/lock")), 0600u);
    fs::remove_all(Path("deep"));
  }
  fs::create_directory(Path("open"));
  chmod(Path("open").c_str(), 0777);
  EXPECT_THAT(MakePrivateFolder(Path("open")), IsOk());
  EXPECT_EQ(ModeOf(Path("open")), 0700u);
}

TEST_F(PrivateFolderTest, OneThatEverybodySharesStaysAsItIs) {
  fs::create_directory(Path("shared"));
  chmod(Path("shared").c_str(), 01777);
  EXPECT_THAT(MakePrivateFolder(Path("shared")), IsOk());
  EXPECT_EQ(ModeOf(Path("shared")), 01777u);
}

TEST_F(PrivateFolderTest, OneOfAnotherUserIsRefused) {
  fs::create_directory(Path("his"));
  directory_.WriteFile("his_file", "");
  if (!GiveAway(Path("his")) || !GiveAway(Path("his_file"))) {
    GTEST_SKIP() << "only root can give files away";
  }
  EXPECT_THAT(MakePrivateFolder(Path("his")),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr(Path("his").string()), HasSubstr("54321"),
                             HasSubstr("run it as that user"))));
  for (const absl::Status& status :
       {OpenPrivateFile(Path("his_file")).status(), CheckOwner(Path("his_file"))}) {
    EXPECT_THAT(status, StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("his_file")));
  }
  EXPECT_THAT(CheckOwner(Path("none")), IsOk());
  EXPECT_THAT(CheckOwner(directory_.path()), IsOk());
}

TEST_F(PrivateFolderTest, LinksAndPipesAreNoFiles) {
  const fs::path target = directory_.WriteFile("target", "untouched");
  fs::create_symlink(target, Path("lock"));
  fs::create_symlink(Path("made_by_nobody"), Path("dangling"));
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  for (const char* name : {"lock", "dangling"}) {
    EXPECT_THAT(OpenPrivateFile(Path(name)),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr(Path(name).string()), HasSubstr("link"))));
  }
  EXPECT_THAT(OpenPrivateFile(Path("pipe")),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("pipe")));
  EXPECT_FALSE(fs::exists(Path("made_by_nobody")));
}

TEST_F(PrivateFolderTest, WhatIsNoFolderIsNamed) {
  directory_.WriteFile("file", "");
  EXPECT_THAT(MakePrivateFolder(Path("file")),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("file")));
  EXPECT_THAT(MakePrivateFolder(Path("file") / "folder"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("file")));
}

}  // namespace
}  // namespace rigcal::testing::private_folder_test
