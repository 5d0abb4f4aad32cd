// SPDX-License-Identifier: Apache-2.0
// A disk that is truly full: a tmpfs of a few megabytes, mounted where only this test sees it.

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <memory>
#include <string>

#include "server/store/sqlite/sqlite_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::full_disk_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::_;
using ::testing::HasSubstr;

constexpr int kCannotMount = 77;

void WriteText(const char* path, const std::string& text) { std::ofstream(path) << text; }

// In a child process: mounts a tmpfs at `path` in a namespace of its own.
bool MountSmallDisk(const std::string& path) {
  const uid_t uid = geteuid();
  const gid_t gid = getegid();
  if (unshare(CLONE_NEWNS) != 0) {
    if (unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return false;
    WriteText("/proc/self/uid_map", "0 " + std::to_string(uid) + " 1");
    WriteText("/proc/self/setgroups", "deny");
    WriteText("/proc/self/gid_map", "0 " + std::to_string(gid) + " 1");
  }
  return mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
         mount("tmpfs", path.c_str(), "tmpfs", 0, "size=8m") == 0;
}

absl::Status AppendRows(SqliteStore& store, const StreamKey& stream, uint32_t first_seq,
                        uint32_t rows) {
  const Delivery delivery = MakeDelivery(MakeBatch(stream, first_seq, first_seq + rows - 1));
  return store.Append({&delivery, 1}).status();
}

void FillDisk(const std::string& path) {
  const std::string bytes(4096, 'x');
  const int file = open((path + "/filler").c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  while (write(file, bytes.data(), bytes.size()) > 0) {
  }
  close(file);
}

void FillDeleteAndGoOn(const std::string& path) {
  SqliteStoreOptions options;
  options.data_directory = path;
  options.reserve_bytes = 1u << 20;
  options.min_free_bytes = 0;
  options.checkpoint_bytes = 1u << 20;
  ASSERT_OK_AND_ASSIGN(auto store, SqliteStore::Open(options));
  ASSERT_THAT(store->CreateSession(CapturingSession({"a"})), IsOk());
  Session other = CapturingSession({"a"});
  other.id = "other";
  ASSERT_THAT(store->CreateSession(other), IsOk());

  uint32_t next_seq = 1;
  absl::Status status;
  for (int batch = 0; batch < 1000 && status.ok(); ++batch) {
    status = AppendRows(*store, KeyOf("a"), next_seq, 500);
    if (status.ok()) next_seq += 500;
  }
  ASSERT_THAT(status, StatusIs(absl::StatusCode::kResourceExhausted, _));
  ASSERT_GT(next_seq, 10'000u);
  // The error repeats, and smaller batches are stored where there is room.
  EXPECT_THAT(AppendRows(*store, KeyOf("a"), next_seq, 5000),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(ReadRows(*store).size(), next_seq - 1);

  // A server that starts on the full disk reads and deletes too.
  store.reset();
  ASSERT_OK_AND_ASSIGN(store, SqliteStore::Open(options));
  EXPECT_EQ(ReadRows(*store).size(), next_seq - 1);
  ASSERT_THAT(store->DeleteSession("s-test"), IsOk());
  StreamKey stream = KeyOf("a");
  stream.session_id = "other";
  EXPECT_THAT(AppendRows(*store, stream, 1, 2000), IsOk());
  EXPECT_EQ(ReadRows(*store, "other").size(), 2000u);

  // What the disk has left is somebody else's now; what was deleted is enough, without compacting.
  FillDisk(path);
  EXPECT_LT(store->Health().free_bytes, 64u << 10);
  uint32_t last = 2000;
  for (status = absl::OkStatus(); status.ok(); last += 500) {
    status = AppendRows(*store, stream, last + 1, 500);
    if (!status.ok()) break;
  }
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_GT(last, next_seq * 7 / 10) << "most of the deleted rows' space is used again";
  EXPECT_EQ(ReadRows(*store, "other").size(), last);
}

// The reserve counts both what the disk has and what the database has.
void GoOnWithUnusedPages(const std::string& path) {
  SqliteStoreOptions options;
  options.data_directory = path;
  options.reserve_bytes = 0;
  options.min_free_bytes = 3u << 20;
  options.checkpoint_bytes = 256u << 10;
  ASSERT_OK_AND_ASSIGN(auto store, SqliteStore::Open(options));
  Session other = CapturingSession({"a"});
  other.id = "other";
  ASSERT_THAT(store->CreateSession(CapturingSession({"a"})), IsOk());
  ASSERT_THAT(store->CreateSession(other), IsOk());
  uint32_t next_seq = 1;
  while (AppendRows(*store, KeyOf("a"), next_seq, 500).ok()) next_seq += 500;
  StreamKey stream = KeyOf("a");
  stream.session_id = "other";
  EXPECT_THAT(AppendRows(*store, stream, 1, 500),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("reserve")));
  ASSERT_THAT(store->DeleteSession("s-test"), IsOk());
  EXPECT_LT(store->Health().free_bytes, options.min_free_bytes);
  EXPECT_GE(store->Health().room_bytes(), options.min_free_bytes);
  EXPECT_THAT(AppendRows(*store, stream, 1, 500), IsOk());
}

void OnSmallDisk(void (*work)(const std::string& path)) {
  const TemporaryDirectory directory;
  std::fflush(stdout);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (!MountSmallDisk(directory.path().string())) _exit(kCannotMount);
    work(directory.path().string());
    std::fflush(stdout);
    _exit(::testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status)) << "killed by signal " << WTERMSIG(status);
  if (WEXITSTATUS(status) == kCannotMount) {
    GTEST_SKIP() << "this system does not let a test mount a tmpfs of its own";
  }
  EXPECT_EQ(WEXITSTATUS(status), 0) << "see the failures above";
}

TEST(FullDisk, ReadsAndDeletesAndGoesOn) { OnSmallDisk(FillDeleteAndGoOn); }

TEST(FullDisk, UnusedPagesCountAsRoom) { OnSmallDisk(GoOnWithUnusedPages); }

}  // namespace
}  // namespace rigcal::server::full_disk_test
