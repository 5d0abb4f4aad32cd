// SPDX-License-Identifier: Apache-2.0
#include "client/local/local_rig.h"

#include <fstream>
#include <optional>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// Generous: only against hanging.
constexpr std::chrono::seconds kStartLimit{60};
constexpr std::chrono::seconds kStopLimit{10};
constexpr std::chrono::milliseconds kLook{10};

std::string AgentName(const std::string& camera) {
  return absl::StrCat("agent of camera ", camera);
}

std::optional<int> ReadPort(const fs::path& file) {
  std::ifstream stream(file);
  int port = 0;
  if (!(stream >> port) || port < 1 || port > 65535) return std::nullopt;
  return port;
}

void StopAll(std::vector<ChildProcess>* processes) {
  for (ChildProcess& process : *processes) process.RequestStop();
  const Clock::time_point deadline = Clock::now() + kStopLimit;
  for (ChildProcess& process : *processes) process.Finish(deadline);
}

}  // namespace

absl::Status LocalRig::StartServer(
    const std::function<absl::Status(std::chrono::milliseconds)>& wait) {
  const fs::path port_file = folder_.path() / "server.port";
  RIGCAL_ASSIGN_OR_RETURN(ChildProcess server,
                          ChildProcess::Start({.name = "server",
                                               .program = programs_ / "rigcal-server",
                                               .arguments = {"--listen", "127.0.0.1:0",
                                                             "--data-dir", folder_.Store().string(),
                                                             "--port-file", port_file.string()},
                                               .log = folder_.Logs() / "server.log"}));
  server_.push_back(std::move(server));
  const Clock::time_point deadline = Clock::now() + kStartLimit;
  while (true) {
    if (const std::optional<int> port = ReadPort(port_file)) {
      address_ = absl::StrCat("127.0.0.1:", *port);
      return absl::OkStatus();
    }
    if (Clock::now() > deadline) {
      return absl::DeadlineExceededError(
          absl::StrCat("the server did not start within ", kStartLimit.count(),
                       " s; the last lines of its log:\n", server_[0].LogTail()));
    }
    RIGCAL_RETURN_IF_ERROR(wait(kLook));
  }
}

absl::Status LocalRig::StartAgents(const std::vector<LocalCamera>& cameras) {
  for (const LocalCamera& camera : cameras) {
    RIGCAL_ASSIGN_OR_RETURN(
        ChildProcess agent,
        ChildProcess::Start(
            {.name = AgentName(camera.name),
             .program = programs_ / "rigcal-agent",
             .arguments = {"--server", address_, "--agent-id", absl::StrCat("local-", camera.name),
                           "--state-dir", (folder_.Agents() / camera.name).string(), "--spool",
                           "memory", "--source", camera.source},
             .log = folder_.Logs() / absl::StrCat("agent_", camera.name, ".log"),
             // No proxy of the user's environment for calls on this machine.
             .environment = {"no_grpc_proxy=127.0.0.1"}}));
    agents_.push_back(std::move(agent));
  }
  return absl::OkStatus();
}

absl::Status LocalRig::CheckRunning() {
  for (std::vector<ChildProcess>* processes : {&agents_, &server_}) {
    for (ChildProcess& process : *processes) RIGCAL_RETURN_IF_ERROR(process.CheckRunning());
  }
  return absl::OkStatus();
}

std::string LocalRig::AgentLogTail(const std::string& camera) const {
  for (const ChildProcess& agent : agents_) {
    if (agent.name() == AgentName(camera)) return agent.LogTail();
  }
  return "";
}

LocalRig::~LocalRig() {
  StopAll(&agents_);
  StopAll(&server_);
}

absl::StatusOr<fs::path> ProgramDirectory() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) return program.parent_path();
  return absl::FailedPreconditionError(
      absl::StrCat("cannot find the folder of this program: ", error.message()));
}

}  // namespace rigcal::client
