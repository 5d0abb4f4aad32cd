// SPDX-License-Identifier: Apache-2.0
#include "client/local/child_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::child_process_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::WaitFor;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class ChildProcessTest : public ::testing::Test {
 protected:
  // A shell that runs the script.
  absl::StatusOr<ChildProcess> Shell(const std::string& script) {
    return ChildProcess::Start({.name = "helper",
                                .program = "/bin/sh",
                                .arguments = {"-c", script},
                                .log = directory_.path() / "log"});
  }
  std::string Log() const {
    std::ifstream stream(directory_.path() / "log");
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  // No process has this id, not even a zombie.
  static bool Gone(pid_t pid) { return kill(pid, 0) != 0 && errno == ESRCH; }
  static std::chrono::steady_clock::time_point Soon() {
    return std::chrono::steady_clock::now() + std::chrono::seconds(60);
  }

  const rigcal::testing::TemporaryDirectory directory_;
};

TEST_F(ChildProcessTest, LogsBothStreamsAndTellsItsExitCode) {
  ASSERT_OK_AND_ASSIGN(ChildProcess child, Shell("echo one; echo two >&2; exit 3"));
  child.Finish(Soon());
  EXPECT_EQ(child.Ended(), "exited with code 3");
  EXPECT_EQ(Log(), "one\ntwo\n");
  EXPECT_THAT(child.CheckRunning(),
              StatusIs(absl::StatusCode::kAborted,
                       AllOf(HasSubstr("helper"), HasSubstr("code 3"), HasSubstr("one\ntwo"))));
}

TEST_F(ChildProcessTest, SaysWhichSignalEndedIt) {
  ASSERT_OK_AND_ASSIGN(ChildProcess child, Shell("exec sleep 1000"));
  EXPECT_THAT(child.CheckRunning(), IsOk());
  kill(child.pid(), SIGKILL);
  ASSERT_TRUE(WaitFor([&] { return child.Ended().has_value(); }));
  EXPECT_THAT(*child.Ended(), HasSubstr("signal 9"));
  EXPECT_THAT(child.CheckRunning(),
              StatusIs(absl::StatusCode::kAborted, HasSubstr("logged nothing")));
}

TEST_F(ChildProcessTest, ShowsOnlyTheLastLinesOfALongLog) {
  ASSERT_OK_AND_ASSIGN(
      ChildProcess child,
      Shell("i=0; while [ $i -lt 5000 ]; do echo line $i; i=$((i+1)); done; echo why; exit 1"));
  child.Finish(Soon());
  EXPECT_EQ(child.LogTail(),
            "line 4993\nline 4994\nline 4995\nline 4996\nline 4997\nline 4998\nline 4999\nwhy");
  EXPECT_THAT(
      child.CheckRunning(),
      StatusIs(absl::StatusCode::kAborted, AllOf(HasSubstr("why"), Not(HasSubstr("line 4000\n")))));
}

TEST_F(ChildProcessTest, ProgramThatIsNotThereIsNamed) {
  EXPECT_THAT(
      ChildProcess::Start({.name = "server",
                           .program = directory_.path() / "rigcal-server",
                           .arguments = {},
                           .log = directory_.path() / "log"}),
      StatusIs(absl::StatusCode::kNotFound,
               AllOf(HasSubstr("server"), HasSubstr("rigcal-server"), HasSubstr("No such file"))));
}

TEST_F(ChildProcessTest, ProgramThatCannotBeRunIsNamed) {
  const auto file = directory_.WriteFile("rigcal-server", "not a program");
  EXPECT_THAT(
      ChildProcess::Start(
          {.name = "server", .program = file, .arguments = {}, .log = directory_.path() / "log"}),
      StatusIs(absl::StatusCode::kNotFound, HasSubstr("ermission denied")));
}

TEST_F(ChildProcessTest, LogThatCannotBeWrittenIsNamed) {
  EXPECT_THAT(ChildProcess::Start({.name = "server",
                                   .program = "/bin/true",
                                   .arguments = {},
                                   .log = directory_.path() / "none" / "log"}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("none/log")));
}

TEST_F(ChildProcessTest, ArgumentsArriveAsTheyAre) {
  ASSERT_OK_AND_ASSIGN(ChildProcess child,
                       ChildProcess::Start({.name = "helper",
                                            .program = "/usr/bin/printf",
                                            .arguments = {"[%s]", "a b", ";", "$HOME", "", "'"},
                                            .log = directory_.path() / "log"}));
  child.Finish(Soon());
  EXPECT_EQ(Log(), "[a b][;][$HOME][][']");
}

TEST_F(ChildProcessTest, EnvironmentIsInheritedExceptForWhatIsGiven) {
  setenv("RIGCAL_TEST_ONE", "inherited", 1);
  setenv("RIGCAL_TEST_TWO", "inherited", 1);
  const auto started = ChildProcess::Start(
      {.name = "helper",
       .program = "/bin/sh",
       .arguments = {"-c",
                     "echo $RIGCAL_TEST_ONE $RIGCAL_TEST_TWO $RIGCAL_TEST_THREE; "
                     "env | grep -cE '^RIGCAL_TEST_(ONE|TWO|THREE)='"},
       .log = directory_.path() / "log",
       .environment = {"RIGCAL_TEST_TWO=given", "RIGCAL_TEST_THREE=new"}});
  unsetenv("RIGCAL_TEST_ONE");
  unsetenv("RIGCAL_TEST_TWO");
  ASSERT_THAT(started, IsOk());
  ASSERT_TRUE(WaitFor([&] { return Log() == "inherited given new\n3\n"; })) << Log();
}

TEST_F(ChildProcessTest, StopsWhenAsked) {
  ASSERT_OK_AND_ASSIGN(
      ChildProcess child,
      Shell("trap 'echo bye; exit 0' TERM; echo ready; while :; do sleep 0.01; done"));
  ASSERT_TRUE(WaitFor([&] { return Log() == "ready\n"; }));
  child.RequestStop();
  child.Finish(Soon());
  EXPECT_EQ(child.Ended(), "exited with code 0");
  EXPECT_EQ(Log(), "ready\nbye\n");
}

TEST_F(ChildProcessTest, IsKilledWhenItDoesNotStop) {
  ASSERT_OK_AND_ASSIGN(ChildProcess child,
                       Shell("trap '' TERM; echo ready; while :; do sleep 0.01; done"));
  ASSERT_TRUE(WaitFor([&] { return Log() == "ready\n"; }));
  const pid_t pid = child.pid();
  child.RequestStop();
  child.Finish(std::chrono::steady_clock::now() + std::chrono::milliseconds(50));
  EXPECT_THAT(*child.Ended(), HasSubstr("signal 9"));
  EXPECT_TRUE(Gone(pid));
}

TEST_F(ChildProcessTest, EndsWithItsObject) {
  pid_t pid = 0;
  {
    ASSERT_OK_AND_ASSIGN(const ChildProcess child, Shell("exec sleep 1000"));
    pid = child.pid();
    EXPECT_FALSE(Gone(pid));
  }
  EXPECT_TRUE(Gone(pid));
}

TEST_F(ChildProcessTest, MovingItDoesNotEndIt) {
  ASSERT_OK_AND_ASSIGN(ChildProcess child, Shell("exec sleep 1000"));
  const pid_t pid = child.pid();
  ChildProcess other(std::move(child));
  EXPECT_THAT(other.CheckRunning(), IsOk());
  EXPECT_EQ(other.pid(), pid);
}

TEST_F(ChildProcessTest, InheritsNoConnectionAndNoStandardInput) {
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);  // on purpose without O_CLOEXEC
  ASSERT_OK_AND_ASSIGN(
      ChildProcess child,
      Shell("readlink /proc/self/fd/0; ls -l /proc/self/fd | grep -c pipe || true"));
  child.Finish(Soon());
  close(pipe_ends[0]);
  close(pipe_ends[1]);
  // `ls | grep` has one pipe of its own.
  EXPECT_EQ(Log(), "/dev/null\n1\n");
}

TEST_F(ChildProcessTest, DiesWithItsParentHoweverThatEnds) {
  // A process in between, which starts a child and is then killed without a chance to clean up.
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  const pid_t parent = fork();
  if (parent == 0) {
    const auto child = Shell("exec sleep 1000");
    const pid_t pid = child.ok() ? child->pid() : -1;
    if (write(pipe_ends[1], &pid, sizeof(pid)) != sizeof(pid)) _exit(1);
    pause();
    _exit(0);
  }
  pid_t child = -1;
  ASSERT_EQ(read(pipe_ends[0], &child, sizeof(child)), static_cast<ssize_t>(sizeof(child)));
  close(pipe_ends[0]);
  close(pipe_ends[1]);
  ASSERT_GT(child, 0);
  EXPECT_EQ(kill(child, 0), 0);
  kill(parent, SIGKILL);
  waitpid(parent, nullptr, 0);
  // Its new parent may be slow to wait for it, so a zombie counts as ended.
  EXPECT_TRUE(WaitFor([&] {
    std::ifstream stat("/proc/" + std::to_string(child) + "/stat");
    const std::string text{std::istreambuf_iterator<char>(stat), {}};
    return text.empty() || text.find(") Z ") != std::string::npos;
  }));
}

}  // namespace
}  // namespace rigcal::client::child_process_test
