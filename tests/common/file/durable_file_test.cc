// SPDX-License-Identifier: Apache-2.0
#include "common/file/durable_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "common/file/may_write.h"
#include "tests/common/file/failing_files.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::durable_file_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// What the disk takes of a file; the program is told by errors, not by a signal.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit = {bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() { setrlimit(RLIMIT_FSIZE, &before_); }

 private:
  rlimit before_ = {};
};

class DurableFileTest : public ::testing::Test {
 protected:
  void SetUp() override { file_faults = {}; }
  void TearDown() override { file_faults = {}; }

  fs::path Path(std::string_view name) const { return directory_.path() / name; }
  std::vector<std::string> Names() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(directory_.path())) {
      names.insert(entry.path().filename().string());
    }
    return {names.begin(), names.end()};
  }
  unsigned ModeOf(const fs::path& path) const {
    struct stat about = {};
    EXPECT_EQ(lstat(path.c_str(), &about), 0) << path;
    return about.st_mode & 07777;
  }

  const TemporaryDirectory directory_;
};

TEST_F(DurableFileTest, IsReplacedWholeAndPrivate) {
  const fs::path path = directory_.WriteFile("a.json", "old");
  for (const mode_t mask : {0000, 0022, 0777}) {
    const mode_t before = umask(mask);
    EXPECT_THAT(WriteDurableFile(path, "new"), IsOk());
    EXPECT_THAT(CreatePrivateFile(Path("b"), "x"), IsOk());
    umask(before);
    EXPECT_EQ(ModeOf(path), 0600u);
    EXPECT_EQ(ModeOf(Path("b")), 0600u);
    EXPECT_EQ(*ReadSmallFile(path), "new");
    EXPECT_THAT(Names(), ElementsAre("a.json", "b"));
    fs::remove(Path("b"));
  }
  EXPECT_EQ(file_faults.syncs, 3 * 3) << "file, its folder, and the other file";
}

TEST_F(DurableFileTest, WhatAUserAskedForHasTheModeOfTheUmask) {
  const mode_t before = umask(0027);
  EXPECT_THAT(WriteOutputFile(Path("a.yaml"), "x"), IsOk());
  umask(before);
  EXPECT_EQ(ModeOf(Path("a.yaml")), 0640u);
  EXPECT_THAT(WriteOutputFile("/dev/null", "x"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("/dev/null")));
  EXPECT_THAT(WriteOutputFile(directory_.path(), "x"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("folder")));
}

TEST_F(DurableFileTest, ShortAndInterruptedWritesAreContinued) {
  file_faults = {.most_per_write = 7, .interrupted_writes = 2};
  const std::string text(1000, 'x');
  for (const auto& write : {&WriteDurableFile, &WriteOutputFile, &CreatePrivateFile}) {
    file_faults.writes = 0;
    ASSERT_THAT(write(Path("a"), text), IsOk());
    EXPECT_GT(file_faults.writes, 1000 / 7);
    EXPECT_EQ(*ReadSmallFile(Path("a")), text);
    fs::remove(Path("a"));
  }
}

// The disk takes a part and then nothing: the case that was reported as success.
TEST_F(DurableFileTest, AFullDiskIsAnErrorAndLeavesTheOldFile) {
  const fs::path path = directory_.WriteFile("a.json", "old");
  const FileSizeLimit limit(100);
  const std::string text(1000, 'x');
  for (const absl::Status& status : {WriteDurableFile(path, text), WriteOutputFile(path, text),
                                     CreatePrivateFile(Path("b"), text)}) {
    EXPECT_THAT(status, StatusIs(absl::StatusCode::kResourceExhausted,
                                 AllOf(HasSubstr("cannot write"), HasSubstr("free space"))));
  }
  EXPECT_EQ(*ReadSmallFile(path), "old");
  EXPECT_THAT(Names(), ElementsAre("a.json")) << "no half file stays";
}

TEST_F(DurableFileTest, AFailedSyncOfTheFileLeavesTheOldOne) {
  const fs::path path = directory_.WriteFile("a.json", "old");
  file_faults = {.failing_sync = 1, .sync_error = EIO};
  EXPECT_THAT(WriteDurableFile(path, "new"),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("cannot sync")));
  EXPECT_EQ(*ReadSmallFile(path), "old");
  EXPECT_THAT(Names(), ElementsAre("a.json"));
}

TEST_F(DurableFileTest, AFailedSyncOfTheFolderIsReported) {
  const fs::path path = directory_.WriteFile("a.json", "old");
  file_faults = {.failing_sync = 2, .sync_error = EIO};
  EXPECT_THAT(WriteDurableFile(path, "new"),
              StatusIs(absl::StatusCode::kInternal,
                       AllOf(HasSubstr("sync the folder"), HasSubstr(directory_.path().string()))));
  file_faults = {.failing_sync = 2, .sync_error = EIO};
  EXPECT_THAT(SyncAndRename(path, Path("b.json")),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("sync the folder")));
  // A file system that cannot sync folders is no fault.
  file_faults = {.failing_sync = 2, .sync_error = EINVAL};
  EXPECT_THAT(WriteDurableFile(path, "new"), IsOk());
}

TEST_F(DurableFileTest, FollowsNoLink) {
  const fs::path target = directory_.WriteFile("target", "untouched");
  fs::create_symlink(target, Path("link"));
  ASSERT_THAT(WriteDurableFile(Path("link"), "new"), IsOk());
  EXPECT_FALSE(fs::is_symlink(Path("link"))) << "the link itself is replaced";
  EXPECT_EQ(*ReadSmallFile(target), "untouched");
  fs::create_symlink(Path("made_by_nobody"), Path("dangling"));
  EXPECT_THAT(CreatePrivateFile(Path("dangling"), "x"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("dangling")));
  EXPECT_FALSE(fs::exists(Path("made_by_nobody")));
  fs::create_symlink(target, Path("from"));
  EXPECT_THAT(SyncAndRename(Path("from"), Path("to")),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("link")));
}

TEST_F(DurableFileTest, WritersDoNotMeetInOneFile) {
  const std::string texts[] = {std::string(70'000, 'a'), std::string(70'000, 'b')};
  {
    std::vector<std::jthread> threads;
    for (const std::string& text : texts) {
      threads.emplace_back([&] {
        for (int i = 0; i < 50; ++i) EXPECT_THAT(WriteDurableFile(Path("a"), text), IsOk());
      });
    }
  }
  const std::string text = *ReadSmallFile(Path("a"));
  EXPECT_TRUE(text == texts[0] || text == texts[1]);
  EXPECT_THAT(Names(), ElementsAre("a"));
}

TEST_F(DurableFileTest, WhatAKilledWriterLeftIsRemoved) {
  for (const char* name : {"a.json", "a.json.12-3.new", "mine.new", "x.y.new", ".1-1.new"}) {
    directory_.WriteFile(name, "x");
  }
  fs::create_directory(Path("folder.1-2.new"));
  RemoveUnfinishedFiles(directory_.path());
  EXPECT_THAT(Names(), ElementsAre(".1-1.new", "a.json", "folder.1-2.new", "mine.new", "x.y.new"));
  RemoveUnfinishedFiles(Path("none"));
}

TEST_F(DurableFileTest, ErrorsNameThePath) {
  EXPECT_THAT(WriteDurableFile(Path("no") / "a", "x"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no/a")));
  EXPECT_THAT(CreatePrivateFile(directory_.WriteFile("taken", "old"), "x"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("taken")));
  EXPECT_EQ(*ReadSmallFile(Path("taken")), "old");
  EXPECT_THAT(SyncFolder(Path("no")), StatusIs(absl::StatusCode::kNotFound, HasSubstr("no")));
}

TEST_F(DurableFileTest, NamesTheFolderThatIsMissingAndNoTemporaryFile) {
  const fs::path path = Path("nodir") / "a.csv";
  for (const absl::Status& status : {WriteOutputFile(path, "x"), CheckOutputFile(path, true)}) {
    EXPECT_THAT(status, StatusIs(absl::StatusCode::kNotFound,
                                 AllOf(HasSubstr("no folder " + Path("nodir").string()),
                                       HasSubstr(path.string()), Not(HasSubstr(".new")))));
  }
}

TEST_F(DurableFileTest, AFileOfAUserStaysWithoutForce) {
  EXPECT_THAT(WriteOutputFile(Path("a.csv"), "x"), IsOk());
  EXPECT_THAT(CheckOutputFile(Path("a.csv"), false, "--plot"),
              StatusIs(absl::StatusCode::kAlreadyExists,
                       AllOf(HasSubstr("--force"), HasSubstr("another --plot"))));
  EXPECT_THAT(CheckOutputFile(Path("a.csv"), true), IsOk());
  EXPECT_THAT(CheckOutputFile(Path("b.csv"), false), IsOk());
}

TEST_F(DurableFileTest, ReadsSmallRegularFilesOnly) {
  EXPECT_THAT(ReadSmallFile(Path("none")),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none")));
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  for (const fs::path& path : {directory_.path(), Path("pipe"), fs::path("/dev/zero")}) {
    EXPECT_THAT(ReadSmallFile(path),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr(path.string())));
  }
  const std::string most(size_t{1} << 20, 'x');
  EXPECT_EQ(ReadSmallFile(directory_.WriteFile("most", most))->size(), most.size());
  EXPECT_THAT(ReadSmallFile(directory_.WriteFile("more", most + "x")),
              StatusIs(absl::StatusCode::kOutOfRange, HasSubstr("more")));
  EXPECT_EQ(*ReadSmallFile(directory_.WriteFile("empty", "")), "");
  EXPECT_THAT(ReadWholeFile(Path("most"), 10),
              StatusIs(absl::StatusCode::kOutOfRange, StartsWith(Path("most").string())));
  EXPECT_EQ(*ReadWholeFile(Path("more"), most.size() + 1), most + "x");
}

}  // namespace
}  // namespace rigcal::testing::durable_file_test
