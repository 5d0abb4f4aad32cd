// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/worker_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/log/correlation_id.h"
#include "common/log/log_fields.h"

namespace rigcal::server {
namespace {

// What posix_spawn takes; freed with it.
struct SpawnSettings {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;

  SpawnSettings(int in, int out) {
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, in, STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, out, STDOUT_FILENO);
    posix_spawnattr_init(&attributes);
    // Signals as a new program expects them, and a group of its own: Ctrl-C is for the server,
    // which ends its workers itself.
    sigset_t none, all;
    sigemptyset(&none);
    sigemptyset(&all);
    for (int signal = 1; signal < 32; ++signal) sigaddset(&all, signal);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  }
  ~SpawnSettings() {
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;
};

// Of this process, and the id of the request that this thread serves.
std::vector<std::string> EnvironmentOfWorker() {
  const std::string name = absl::StrCat(kCorrelationVariable, "=");
  std::vector<std::string> variables;
  for (char** each = environ; *each != nullptr; ++each) {
    if (!std::string_view(*each).starts_with(name)) variables.emplace_back(*each);
  }
  const std::string& id = LogFields::Current().correlation;
  if (!id.empty()) variables.push_back(name + id);
  return variables;
}

}  // namespace

absl::StatusOr<WorkerProcess> WorkerProcess::Start(const std::filesystem::path& program,
                                                   const std::vector<std::string>& arguments,
                                                   int in) {
  int out[2];
  if (pipe2(out, O_CLOEXEC) != 0) {
    return absl::ResourceExhaustedError(
        absl::StrCat("cannot make a pipe to ", program.string(), ": ", strerror(errno)));
  }
  std::vector<std::string> words = {program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  const std::vector<std::string> variables = EnvironmentOfWorker();
  std::vector<char*> environment;
  for (const std::string& variable : variables) {
    environment.push_back(const_cast<char*>(variable.c_str()));
  }
  environment.push_back(nullptr);
  const SpawnSettings settings(in, out[1]);
  pid_t pid = -1;
  const int error = posix_spawn(&pid, program.c_str(), &settings.files, &settings.attributes,
                                pointers.data(), environment.data());
  close(out[1]);
  if (error != 0) {
    close(out[0]);
    return absl::FailedPreconditionError(absl::StrCat("cannot start ", program.string(), ": ",
                                                      strerror(error),
                                                      "; it is installed beside rigcal-server"));
  }
  return WorkerProcess(pid, out[0]);
}

WorkerProcess::WorkerProcess(WorkerProcess&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)),
      out_(std::exchange(other.out_, -1)),
      status_(other.status_) {}

WorkerProcess::~WorkerProcess() {
  Kill();
  Wait();
  if (out_ >= 0) close(out_);
}

absl::StatusOr<std::string> WorkerProcess::Read(size_t size, std::chrono::milliseconds limit,
                                                bool* ended) {
  *ended = false;
  pollfd waiting = {.fd = out_, .events = POLLIN, .revents = 0};
  const int ready = poll(&waiting, 1, static_cast<int>(limit.count()));
  if (ready == 0 || (ready < 0 && errno == EINTR)) return std::string();
  std::string bytes(size, '\0');
  const ssize_t count = ready < 0 ? -1 : read(out_, bytes.data(), bytes.size());
  if (count < 0 && errno == EINTR) return std::string();
  if (count < 0) {
    return absl::UnavailableError(absl::StrCat("cannot read from the worker: ", strerror(errno)));
  }
  *ended = count == 0;
  bytes.resize(static_cast<size_t>(count));
  return bytes;
}

void WorkerProcess::Kill() {
  if (pid_ > 0) kill(pid_, SIGKILL);
}

int WorkerProcess::Wait() {
  if (pid_ > 0) {
    while (waitpid(pid_, &status_, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
  }
  return status_;
}

}  // namespace rigcal::server
