// SPDX-License-Identifier: Apache-2.0
// PostgreSQL's disk becomes full during a capture and has room again: nothing ends, nothing is
// lost, and server, doctor and readiness say what is wrong. The disk is a small tmpfs in a mount
// namespace of this thread.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/integration/running_wave.h"

namespace rigcal::testing::database_disk_full_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

// A tmpfs that this thread and what it starts see, and nobody else.
class SmallDisk {
 public:
  SmallDisk() {
    fs::create_directories(mount_point_);
    // PostgreSQL is another user.
    fs::permissions(directory_.path(), fs::perms(0755));
    if (unshare(CLONE_NEWNS) != 0 ||
        mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        mount("tmpfs", mount_point_.c_str(), "tmpfs", 0, "size=40m,mode=0755") != 0) {
      problem_ = std::strerror(errno);
      return;
    }
    fs::create_directories(database());
  }
  ~SmallDisk() {
    if (problem_.empty()) umount2(mount_point_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  // Why there is none; empty: there is one.
  const std::string& problem() const { return problem_; }
  fs::path database() const { return mount_point_ / "database"; }
  // Until nothing more can be written.
  void Fill() const {
    const int file = open((mount_point_ / "filler").c_str(), O_WRONLY | O_CREAT, 0600);
    ASSERT_GE(file, 0);
    const std::string bytes(4096, 'x');
    while (write(file, bytes.data(), bytes.size()) > 0) {
    }
    close(file);
  }
  void Free() const { fs::remove(mount_point_ / "filler"); }

 private:
  const TemporaryDirectory directory_;
  const fs::path mount_point_ = directory_.path() / "disk";
  std::string problem_;
};

class HasSmallDisk {
 protected:
  bool usable() const { return PostgresCluster::Installed() && disk_.problem().empty(); }
  SmallDisk disk_;
};

class DatabaseDiskFull : public HasSmallDisk, public RunningWave {
 protected:
  DatabaseDiskFull()
      : RunningWave(usable() ? "postgresql" : "sqlite", 1200,
                    {.database_folder = usable() ? disk_.database().string() : std::string()}) {}
  void SetUp() override {
    if (!usable()) {
      GTEST_SKIP() << "no PostgreSQL server, or no small disk can be mounted here: "
                   << disk_.problem();
    }
  }
  std::string Doctor() {
    const CommandResult doctor = RunCommand({"rigcal", "doctor", "--server", server_->address()});
    return doctor.output + doctor.error;
  }
};

TEST_F(DatabaseDiskFull, IsNamedAndNothingIsLostOnceThereIsRoom) {
  Begin();
  const std::string address = server_->address();
  ASSERT_TRUE(WaitFor([&] { return StoredCount(address) > 200; }))
      << server_->process().StandardError();
  disk_.Fill();
  ASSERT_TRUE(WaitFor([&] {
    return server_->process().StandardError().find("the disk of the database is full") !=
           std::string::npos;
  })) << server_->process().StandardError();
  EXPECT_THAT(Doctor(), AllOf(HasSubstr("the disk of the database is full"),
                              HasSubstr("No space left on device")));
  // It reads, and agents go on.
  const uint64_t stored = StoredCount(address);
  EXPECT_GT(stored, 0u);
  EXPECT_TRUE(agents_[0]->Running());
  disk_.Free();
  ASSERT_TRUE(WaitFor([&] { return StoredCount(address) > stored; }))
      << server_->process().StandardError();
  EXPECT_TRUE(WaitFor([&] {
    return Doctor().find("the disk of the database is full") == std::string::npos;
  })) << Doctor();
  ExpectNothingLostAndTheSameResult();
}

}  // namespace
}  // namespace rigcal::testing::database_disk_full_test
