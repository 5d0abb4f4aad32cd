// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/worker_process.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "tests/testing/status_matchers.h"

namespace rigcal::server::worker_process_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using std::chrono::milliseconds;
using ::testing::HasSubstr;

const std::filesystem::path kWorker = std::filesystem::path(RIGCAL_BIN_DIR) / "rigcal-worker";
constexpr std::chrono::seconds kHang{60};

int Null() {
  static const int null = open("/dev/null", O_RDONLY | O_CLOEXEC);
  return null;
}

std::string ReadAll(WorkerProcess* process) {
  std::string all;
  const auto limit = std::chrono::steady_clock::now() + kHang;
  for (bool ended = false; !ended && std::chrono::steady_clock::now() < limit;) {
    const auto bytes = process->Read(4096, milliseconds(100), &ended);
    EXPECT_THAT(bytes, IsOk());
    if (!bytes.ok()) break;
    all += *bytes;
  }
  return all;
}

// True while it runs; a zombie does not.
bool IsRunning(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string number, name, state;
  return file >> number >> name >> state && state != "Z";
}

TEST(WorkerProcess, GivesWhatTheProgramWritesAndItsEnd) {
  ASSERT_OK_AND_ASSIGN(auto process,
                       WorkerProcess::Start("/bin/sh", {"-c", "echo some words; exit 3"}, Null()));
  EXPECT_EQ(ReadAll(&process), "some words\n");
  const int status = process.Wait();
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 3);
}

TEST(WorkerProcess, NamesAProgramThatCannotBeStarted) {
  EXPECT_THAT(WorkerProcess::Start("/nowhere/rigcal-worker", {}, Null()),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("/nowhere/rigcal-worker"), HasSubstr("No such file"))));
}

TEST(WorkerProcess, DestroyedItTakesItsProgramWithIt) {
  pid_t pid = 0;
  {
    ASSERT_OK_AND_ASSIGN(const auto process, WorkerProcess::Start("/bin/sleep", {"600"}, Null()));
    pid = process.pid();
    EXPECT_TRUE(IsRunning(pid));
  }
  EXPECT_FALSE(IsRunning(pid));
}

TEST(WorkerProcess, TheProgramHasItsSignalsAsUsual) {
  signal(SIGPIPE, SIG_IGN);
  ASSERT_OK_AND_ASSIGN(
      auto process,
      WorkerProcess::Start("/bin/sh", {"-c", "grep -E 'Sig(Ign|Blk)' /proc/self/status"}, Null()));
  std::string text = ReadAll(&process);
  unsigned long long blocked = 1, ignored = 1;  // NOLINT: for sscanf
  ASSERT_EQ(std::sscanf(text.c_str(), "SigBlk: %llx SigIgn: %llx", &blocked, &ignored), 2) << text;
  EXPECT_EQ(blocked, 0u);
  // The two above belong to the C library's threads.
  EXPECT_EQ(ignored & 0x7fffffffu, 0u) << text;
}

TEST(Worker, EndsWithTheProcessThatStartedIt) {
  std::array<int, 2> report{}, input{};
  ASSERT_EQ(pipe2(report.data(), O_CLOEXEC), 0);
  ASSERT_EQ(pipe2(input.data(), O_CLOEXEC), 0);
  const pid_t starter = fork();
  if (starter == 0) {
    // Input that never ends: by itself the worker would wait for it for ever.
    const auto process =
        WorkerProcess::Start(kWorker, {"--parent=" + std::to_string(getpid())}, input[0]);
    const pid_t pid = process.ok() ? process->pid() : 0;
    (void)!write(report[1], &pid, sizeof(pid));
    while (true) pause();
  }
  pid_t worker = 0;
  ASSERT_EQ(read(report[0], &worker, sizeof(worker)), ssize_t{sizeof(worker)});
  ASSERT_GT(worker, 0);
  // It has set up its end once it is less important than others.
  const auto limit = std::chrono::steady_clock::now() + kHang;
  const auto in_time = [limit] { return std::chrono::steady_clock::now() < limit; };
  std::string score;
  while (score != "800" && in_time()) {
    std::ifstream("/proc/" + std::to_string(worker) + "/oom_score_adj") >> score;
    std::this_thread::sleep_for(milliseconds(2));
  }
  EXPECT_TRUE(IsRunning(worker));
  kill(starter, SIGKILL);
  waitpid(starter, nullptr, 0);
  while (IsRunning(worker) && in_time()) std::this_thread::sleep_for(milliseconds(2));
  EXPECT_FALSE(IsRunning(worker));
  for (const int end : {report[0], report[1], input[0], input[1]}) close(end);
}

TEST(Worker, DoesNotRunForAProcessThatHasGone) {
  ASSERT_OK_AND_ASSIGN(auto process, WorkerProcess::Start(kWorker, {"--parent=1"}, Null()));
  EXPECT_EQ(ReadAll(&process), "");
  const int status = process.Wait();
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
}

}  // namespace
}  // namespace rigcal::server::worker_process_test
