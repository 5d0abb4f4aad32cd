// SPDX-License-Identifier: Apache-2.0
#include "agent/command/join_service.h"

#include <pwd.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// OK: it has ended with 0.
absl::Status RunStep(const std::vector<std::string>& command) {
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  pid_t child = 0;
  int status = posix_spawnp(&child, arguments[0], nullptr, nullptr, arguments.data(), environ);
  if (status == 0) {
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return absl::OkStatus();
  }
  // The join string is a secret.
  return absl::FailedPreconditionError(
      absl::StrCat("`", command[0], " ", command[1], " ", command[2], "` failed"));
}

// Without systemd, as in a container, there is no service to stop.
absl::Status Systemctl(const char* verb) {
  std::error_code ignored;
  if (!std::filesystem::exists("/run/systemd/system", ignored)) return absl::OkStatus();
  return RunStep({"systemctl", verb, kServiceName});
}

}  // namespace

bool JoinsForService() {
  std::error_code ignored;
  return geteuid() == 0 && std::filesystem::exists(kServiceConfig, ignored) &&
         getpwnam(kServiceName) != nullptr;
}

absl::Status JoinForService(const std::vector<std::string>& arguments) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return absl::InternalError("this program does not find itself: /proc/self/exe");
  std::vector<std::string> join = {"runuser",     "-u",   kServiceName, "--",
                                   self.string(), "join", "--config",   kServiceConfig};
  join.insert(join.end(), arguments.begin(), arguments.end());
  RIGCAL_RETURN_IF_ERROR(Systemctl("stop"));
  const absl::Status joined = RunStep(join);
  // Also where it has not joined: it ran before.
  const absl::Status started = Systemctl("start");
  return joined.ok() ? started : joined;
}

}  // namespace rigcal::agent
