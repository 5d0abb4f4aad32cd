// SPDX-License-Identifier: Apache-2.0
#include "client/local/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace rigcal::client {
namespace {

constexpr int kTailLines = 8;
constexpr std::streamoff kTailBytes = 16384;
constexpr int kPollMs = 5;
// From linux/close_range.h, which some systems lack.
constexpr int kCloseRangeCloexec = 1 << 2;

absl::Status Errno(const std::string& what) {
  return absl::FailedPreconditionError(absl::StrCat(what, ": ", strerror(errno)));
}

// Runs in the child between fork and exec: only system calls, as other threads of the parent may
// have held any lock.
[[noreturn]] void BecomeProgram(char* const* arguments, char* const* environment, int log,
                                int status_pipe, pid_t parent) {
  const auto fail = [&] {
    const int error = errno;
    [[maybe_unused]] const ssize_t ignored = write(status_pipe, &error, sizeof(error));
    _exit(127);
  };
  if (prctl(PR_SET_PDEATHSIG, SIGKILL) != 0) fail();
  // The parent may have ended before the line above.
  if (getppid() != parent) _exit(127);
  // Its own group: Ctrl-C goes to the parent only, which stops its children in order.
  setpgid(0, 0);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) ::signal(signal, SIG_DFL);
  const int null = open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (null < 0 || dup2(null, STDIN_FILENO) < 0 || dup2(log, STDOUT_FILENO) < 0 ||
      dup2(log, STDERR_FILENO) < 0) {
    fail();
  }
  // The parent's connections must not stay open in it. Kernels before 5.11 lack this flag; there
  // only descriptors opened with O_CLOEXEC close.
  close_range(STDERR_FILENO + 1, ~0U, kCloseRangeCloexec);
  execve(arguments[0], arguments, environment);
  fail();
  _exit(127);
}

// As exec takes them.
std::vector<char*> Pointers(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

std::vector<std::string> Environment(const std::vector<std::string>& first) {
  std::vector<std::string> all = first;
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) {
    const std::string inherited = *entry;
    const std::string name = inherited.substr(0, inherited.find('=') + 1);
    const bool replaced = std::ranges::any_of(
        first, [&](const std::string& own) { return !name.empty() && own.starts_with(name); });
    if (!replaced) all.push_back(inherited);
  }
  return all;
}

std::string EndOf(int status) {
  if (WIFEXITED(status)) return absl::StrCat("exited with code ", WEXITSTATUS(status));
  const int signal = WTERMSIG(status);
  return absl::StrCat("was ended by signal ", signal, " (", strsignal(signal), ")");
}

}  // namespace

absl::StatusOr<ChildProcess> ChildProcess::Start(ChildProcessOptions options) {
  const int log =
      open(options.log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0644);
  if (log < 0) return Errno(absl::StrCat("cannot write the log ", options.log.string()));
  int status_pipe[2];
  if (pipe2(status_pipe, O_CLOEXEC) != 0) {
    absl::Status status = Errno("cannot make a pipe");
    close(log);
    return status;
  }
  std::vector<std::string> words = {options.program.string()};
  words.insert(words.end(), options.arguments.begin(), options.arguments.end());
  std::vector<std::string> environment = Environment(options.environment);
  const std::vector<char*> argument_pointers = Pointers(words);
  const std::vector<char*> environment_pointers = Pointers(environment);

  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid == 0) {
    BecomeProgram(argument_pointers.data(), environment_pointers.data(), log, status_pipe[1],
                  parent);
  }
  absl::Status forked =
      pid < 0 ? Errno(absl::StrCat("cannot start the ", options.name)) : absl::OkStatus();
  close(log);
  close(status_pipe[1]);
  int exec_error = 0;
  ssize_t got = 0;
  // An empty pipe: exec has succeeded.
  do {
    got = forked.ok() ? read(status_pipe[0], &exec_error, sizeof(exec_error)) : 0;
  } while (got < 0 && errno == EINTR);
  close(status_pipe[0]);
  if (!forked.ok()) return forked;
  ChildProcess child(std::move(options), pid);
  if (got != sizeof(exec_error)) return child;
  return absl::NotFoundError(absl::StrCat("cannot start the ", child.options_.name, ", ",
                                          child.options_.program.string(), ": ",
                                          strerror(exec_error)));
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept
    : options_(std::move(other.options_)),
      pid_(std::exchange(other.pid_, -1)),
      ended_(std::move(other.ended_)) {}

ChildProcess::~ChildProcess() { Kill(); }

std::optional<std::string> ChildProcess::Ended() {
  if (ended_.has_value() || pid_ < 0) return ended_;
  int status = 0;
  const pid_t got = waitpid(pid_, &status, WNOHANG);
  if (got == pid_) ended_ = EndOf(status);
  // Already reaped, because SIGCHLD is ignored in this process.
  if (got < 0 && errno == ECHILD) ended_ = "ended";
  return ended_;
}

absl::Status ChildProcess::CheckRunning() {
  const std::optional<std::string> ended = Ended();
  if (!ended.has_value()) return absl::OkStatus();
  const std::string tail = LogTail();
  return absl::AbortedError(
      absl::StrCat("the ", options_.name, " ", *ended,
                   tail.empty() ? "; it logged nothing" : "; the last lines of its log:\n" + tail));
}

void ChildProcess::RequestStop() {
  if (pid_ > 0 && !Ended().has_value()) kill(pid_, SIGTERM);
}

void ChildProcess::Finish(std::chrono::steady_clock::time_point deadline) {
  while (pid_ > 0 && !Ended().has_value()) {
    if (std::chrono::steady_clock::now() >= deadline) return Kill();
    poll(nullptr, 0, kPollMs);
  }
}

void ChildProcess::Kill() {
  if (pid_ <= 0 || Ended().has_value()) return;
  kill(pid_, SIGKILL);
  Finish(std::chrono::steady_clock::time_point::max());
}

std::string ChildProcess::LogTail() const {
  std::ifstream file(options_.log, std::ios::binary);
  file.seekg(0, std::ios::end);
  const std::streamoff size = file.tellg();
  file.seekg(std::max<std::streamoff>(0, size - kTailBytes));
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  std::vector<std::string> all =
      absl::StrSplit(std::string(absl::StripTrailingAsciiWhitespace(text)), '\n');
  if (std::ssize(all) > kTailLines) all.erase(all.begin(), all.end() - kTailLines);
  return absl::StrJoin(all, "\n");
}

}  // namespace rigcal::client
