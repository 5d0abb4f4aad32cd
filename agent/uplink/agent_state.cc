// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/agent_state.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"

namespace rigcal::agent {
namespace {

constexpr char kStateFile[] = "agent.state";
constexpr char kLockFile[] = "lock";

absl::Status Errno(const std::string& what, const std::filesystem::path& path) {
  return absl::ErrnoToStatus(errno, absl::StrCat("cannot ", what, " ", path.string()));
}

absl::StatusOr<int> Lock(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / kLockFile;
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd < 0) return Errno("open", path);
  // The kernel releases it when the process ends, however that happens.
  if (flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  absl::Status status = errno == EWOULDBLOCK
                            ? absl::AlreadyExistsError(absl::StrCat(
                                  "another agent uses the state directory ", directory.string(),
                                  "; stop it, or give this one another --state-dir"))
                            : Errno("lock", path);
  close(fd);
  return status;
}

absl::Status Sync(const std::filesystem::path& path, int flags) {
  const int fd = open(path.c_str(), flags | O_CLOEXEC);
  if (fd < 0) return Errno("open", path);
  const absl::Status status = fsync(fd) == 0 ? absl::OkStatus() : Errno("sync", path);
  close(fd);
  return status;
}

std::string MadeAgentId() {
  std::random_device random;
  return absl::StrFormat("%s-%08x", HostName().substr(0, 48), random());
}

// `key=value` lines. Incarnation 0: there is no file yet.
absl::StatusOr<AgentIdentity> Load(const std::filesystem::path& path) {
  AgentIdentity identity;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    if (!error) return identity;
    return absl::UnavailableError(
        absl::StrCat("cannot read ", path.string(), ": ", error.message()));
  }
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  for (const absl::string_view line : absl::StrSplit(text.str(), '\n')) {
    const std::pair<std::string, std::string> pair = absl::StrSplit(line, absl::MaxSplits('=', 1));
    if (pair.first == "agent_id") identity.agent_id = pair.second;
    if (pair.first == "incarnation" && !absl::SimpleAtoi(pair.second, &identity.incarnation)) {
      identity.incarnation = 0;
    }
  }
  constexpr uint32_t kLast = std::numeric_limits<uint32_t>::max();
  if (identity.incarnation == 0 || identity.incarnation == kLast ||
      !ValidateName("agent_id", identity.agent_id).ok()) {
    return absl::DataLossError(
        absl::StrCat(path.string(),
                     " is damaged: it must hold agent_id=NAME and incarnation=NUMBER; remove "
                     "the file to start as a new agent"));
  }
  return identity;
}

absl::Status Save(const std::filesystem::path& directory, const AgentIdentity& identity) {
  const std::filesystem::path path = directory / kStateFile;
  const std::filesystem::path temporary = directory / (std::string(kStateFile) + ".new");
  {
    std::ofstream file(temporary, std::ios::trunc);
    file << "agent_id=" << identity.agent_id << "\nincarnation=" << identity.incarnation << '\n';
    if (!file.flush()) return Errno("write", temporary);
  }
  RIGCAL_RETURN_IF_ERROR(Sync(temporary, O_RDONLY));
  if (std::rename(temporary.c_str(), path.c_str()) != 0) return Errno("replace", path);
  return Sync(directory, O_RDONLY | O_DIRECTORY);
}

}  // namespace

std::string HostName() {
  std::array<char, 256> buffer{};
  if (gethostname(buffer.data(), buffer.size() - 1) != 0) return "host";
  std::string name(buffer.data());
  name.resize(std::min(name.find('.'), name.size()));
  std::replace_if(
      name.begin(), name.end(),
      [](char c) { return !absl::ascii_isalnum(static_cast<unsigned char>(c)); }, '-');
  return name.empty() ? "host" : name;
}

absl::StatusOr<AgentState> AgentState::Open(const std::filesystem::path& directory,
                                            const std::string& agent_id) {
  if (!agent_id.empty()) RIGCAL_RETURN_IF_ERROR(ValidateName("agent_id", agent_id));
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) {
    return absl::ErrnoToStatus(
        error.value(), absl::StrCat("cannot create the state directory ", directory.string()));
  }
  RIGCAL_ASSIGN_OR_RETURN(const int lock_fd, Lock(directory));
  AgentState state(lock_fd);
  RIGCAL_ASSIGN_OR_RETURN(state.identity_, Load(directory / kStateFile));
  if (!agent_id.empty()) state.identity_.agent_id = agent_id;
  if (state.identity_.agent_id.empty()) state.identity_.agent_id = MadeAgentId();
  ++state.identity_.incarnation;
  RIGCAL_RETURN_IF_ERROR(Save(directory, state.identity_));
  return state;
}

absl::StatusOr<std::filesystem::path> AgentState::DefaultDirectory(const std::string& agent_id) {
  const std::filesystem::path name = agent_id.empty() ? "default" : agent_id;
  for (const auto& [variable, below] :
       {std::pair{"XDG_STATE_HOME", ""}, {"HOME", ".local/state"}}) {
    const char* const folder = std::getenv(variable);
    // The XDG specification says to ignore a relative path there.
    if (folder == nullptr || folder[0] != '/') continue;
    return std::filesystem::path(folder) / below / "rigcal" / "agent" / name;
  }
  return absl::FailedPreconditionError(
      "neither XDG_STATE_HOME nor HOME is set: give --state-dir DIR");
}

AgentState::AgentState(AgentState&& other) noexcept
    : lock_fd_(std::exchange(other.lock_fd_, -1)), identity_(std::move(other.identity_)) {}

AgentState::~AgentState() {
  if (lock_fd_ >= 0) close(lock_fd_);
}

}  // namespace rigcal::agent
