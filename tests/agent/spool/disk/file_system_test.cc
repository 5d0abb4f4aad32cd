// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/file_system.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "agent/spool/disk/disk_spool.h"
#include "tests/agent/uplink/scripted_source.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::file_system_test {
namespace {

namespace fs = std::filesystem;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::HasSubstr;

const StreamKey kLeft{"s-1", "left", 3};

unsigned ModeOf(const fs::path& path) {
  struct stat about {};
  EXPECT_EQ(stat(path.c_str(), &about), 0) << path;
  return about.st_mode & 0777u;
}

DiskSpoolOptions OptionsFor(const TemporaryDirectory& directory) {
  DiskSpoolOptions options;
  options.folder = (directory.path() / "spool").string();
  return options;
}

TEST(RealFileSystem, WritesReadsAndNamesTheFileOfAnError) {
  const TemporaryDirectory directory;
  FileSystem& files = RealFileSystem();
  const std::string path = (directory.path() / "a").string();
  EXPECT_THAT(files.Open(path), StatusIs(absl::StatusCode::kNotFound, HasSubstr(path)));
  ASSERT_OK_AND_ASSIGN(const auto file, files.Create(path));
  ASSERT_THAT(file->WriteAt(0, "0123456789"), IsOk());
  ASSERT_THAT(file->WriteAt(8, "ab"), IsOk());
  ASSERT_THAT(file->Truncate(9), IsOk());
  ASSERT_THAT(file->Sync(), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::string bytes, file->ReadAt(6, 100));
  EXPECT_EQ(bytes, "67a");
  ASSERT_THAT(files.Rename(path, path + "b"), IsOk());
  ASSERT_THAT(files.SyncFolder(directory.path().string()), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto names, files.List(directory.path().string()));
  ASSERT_EQ(names.size(), 1u);
  EXPECT_EQ(names[0].name, "ab");
  EXPECT_EQ(names[0].size, 9u);
  EXPECT_THAT(files.Remove(path), IsOk());
  EXPECT_THAT(files.Create((directory.path() / "no" / "a").string()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no/a")));
}

TEST(RealFileSystem, KeepsTheSpoolToItsOwner) {
  const TemporaryDirectory directory;
  const DiskSpoolOptions options = OptionsFor(directory);
  ASSERT_OK_AND_ASSIGN(const auto spool, DiskSpool::Create(options));
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  ASSERT_THAT(spool->Append(kLeft, MakeObservation(1), {}), IsOk());
  spool->Maintain();
  EXPECT_EQ(ModeOf(options.folder), 0700u);
  int files = 0;
  for (const auto& entry : fs::directory_iterator(options.folder)) {
    EXPECT_EQ(ModeOf(entry.path()), 0600u) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 3) << "lock, checkpoint and a segment";
}

TEST(RealFileSystem, LetsOneAgentAtATimeUseASpool) {
  const TemporaryDirectory directory;
  const DiskSpoolOptions options = OptionsFor(directory);
  {
    ASSERT_OK_AND_ASSIGN(const auto first, DiskSpool::Create(options));
    EXPECT_THAT(DiskSpool::Create(options),
                StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("--state-dir")));
  }
  EXPECT_THAT(DiskSpool::Create(options), IsOk());
}

TEST(RealFileSystem, KeepsRowsOverARestart) {
  const TemporaryDirectory directory;
  const DiskSpoolOptions options = OptionsFor(directory);
  {
    ASSERT_OK_AND_ASSIGN(const auto spool, DiskSpool::Create(options));
    ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
    for (int row = 1; row <= 300; ++row) {
      ASSERT_THAT(spool->Append(kLeft, MakeObservation(row), {}), IsOk());
    }
    spool->Acknowledge(kLeft, 100);
  }
  ASSERT_OK_AND_ASSIGN(const auto spool, DiskSpool::Create(options));
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool->Read(kLeft, 101, 1000));
  EXPECT_EQ(batch.rows(), 200u);
  EXPECT_EQ(batch.time_ns[199], 300);
}

TEST(RealFileSystem, HasAllOfASpoolThatWasClosed) {
  const TemporaryDirectory directory;
  DiskSpoolOptions options = OptionsFor(directory);
  options.has_thread = false;
  {
    ASSERT_OK_AND_ASSIGN(const auto spool, DiskSpool::Create(options));
    ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
    for (int row = 1; row <= 30; ++row) {
      ASSERT_THAT(spool->Append(kLeft, MakeObservation(row), {}), IsOk());
    }
    spool->Acknowledge(kLeft, 12);
    ASSERT_THAT(spool->Finish(kLeft, {}), IsOk());
  }
  ASSERT_OK_AND_ASSIGN(const auto spool, DiskSpool::Create(options));
  const auto stream = spool->Find(kLeft);
  ASSERT_TRUE(stream.has_value());
  EXPECT_EQ(stream->durable_seq, 12u);
  ASSERT_TRUE(stream->end.has_value());
  EXPECT_FALSE(stream->end->interrupted) << "the end of the capture is in the checkpoint";
}

// An open file keeps its space: with one, a full disk would stay full.
TEST(RealFileSystem, HasNoDeletedSegmentOpen) {
  const TemporaryDirectory directory;
  DiskSpoolOptions options = OptionsFor(directory);
  options.has_thread = false;
  ASSERT_OK_AND_ASSIGN(const auto spool, DiskSpool::Create(options));
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  for (int row = 1; row <= 300; ++row) {
    ASSERT_THAT(spool->Append(kLeft, MakeObservation(row), {}), IsOk());
  }
  ASSERT_THAT(spool->Read(kLeft, 1, 1000), IsOk());
  ASSERT_THAT(spool->Finish(kLeft, {}), IsOk());
  spool->Acknowledge(kLeft, 300);
  spool->Maintain();
  for (const auto& entry : fs::directory_iterator(options.folder)) {
    EXPECT_NE(entry.path().extension(), ".seg") << "everything is acknowledged";
  }
  std::error_code gone;  // the descriptor of this loop, for one
  for (const auto& entry : fs::directory_iterator("/proc/self/fd")) {
    const std::string file = fs::read_symlink(entry.path(), gone).string();
    EXPECT_FALSE(file.starts_with(options.folder) && file.ends_with(" (deleted)")) << file;
  }
}

}  // namespace
}  // namespace rigcal::agent::file_system_test
