// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/command/join_service.h"
#include "agent/command/subcommands.h"
#include "agent/uplink/agent_state.h"
#include "common/config/agent_config.h"
#include "common/discovery/join_found_server.h"
#include "common/enrolment/join_server.h"
#include "common/identity/identity_folder.h"
#include "common/identity/join_string.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

struct JoinFlags {
  std::string join_string;
  std::string server;
  std::string config;
  std::string state_dir;
  std::string agent_id;
  bool force = false;
};

absl::StatusOr<std::filesystem::path> StateDirectory(const JoinFlags& flags,
                                                     const AgentConfig& config) {
  if (!flags.state_dir.empty()) return flags.state_dir;
  if (!config.state_dir.empty()) return config.state_dir;
  return AgentState::DefaultDirectory(config.agent_id);
}

// What finds the same folder when the agent is started.
std::string StartFlags(const JoinFlags& flags) {
  std::string text;
  if (!flags.config.empty()) absl::StrAppend(&text, " --config ", flags.config);
  if (!flags.state_dir.empty()) absl::StrAppend(&text, " --state-dir ", flags.state_dir);
  if (!flags.agent_id.empty()) absl::StrAppend(&text, " --agent-id ", flags.agent_id);
  return text;
}

// At the server of the join string, or where it is by what the flags and people say.
absl::StatusOr<PeerIdentity> JoinSomewhere(const JoinFlags& flags, JoinString join,
                                           const std::string& agent_id, Discovery* discovery,
                                           const Dialog& dialog) {
  if (flags.server.empty()) return JoinFoundServer(join, agent_id, discovery, dialog);
  join.hosts.resize(1);
  if (!SplitHostPort(flags.server, &join.hosts[0], &join.https_port)) {
    return absl::InvalidArgumentError(absl::StrCat("--server ", flags.server, " is not HOST:PORT"));
  }
  return JoinServer(join, agent_id);
}

// Of the agent that the package runs: what root types after installing it.
absl::Status JoinPackagedAgent(const JoinFlags& flags, std::ostream& out) {
  std::vector<std::string> arguments;
  if (!flags.join_string.empty()) arguments.push_back(flags.join_string);
  if (!flags.server.empty()) arguments.insert(arguments.end(), {"--server", flags.server});
  if (!flags.agent_id.empty()) arguments.insert(arguments.end(), {"--agent-id", flags.agent_id});
  if (flags.force) arguments.emplace_back("--force");
  RIGCAL_RETURN_IF_ERROR(JoinForService(arguments));
  out << "service rigcal-agent runs with it: `rigcal cameras` on the server's PC, or its page Rig, "
         "lists the cameras that this PC sees\n";
  return absl::OkStatus();
}

absl::Status JoinAsAgent(const JoinFlags& flags, std::ostream& out) {
  if (flags.config.empty() && flags.state_dir.empty() && JoinsForService()) {
    return JoinPackagedAgent(flags, out);
  }
  const bool is_terminal = isatty(STDIN_FILENO) == 1 && isatty(STDOUT_FILENO) == 1;
  const Dialog dialog{.out = out, .in = is_terminal ? &std::cin : nullptr};
  const std::unique_ptr<Discovery> discovery = MakeDiscovery();
  std::string join_string = flags.join_string;
  if (join_string.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(join_string, AskForJoinString(discovery.get(), dialog));
  }
  RIGCAL_ASSIGN_OR_RETURN(const JoinString join, ParseJoinString(join_string));
  if (join.role != Role::kAgent) {
    return absl::InvalidArgumentError(absl::StrCat("the join string is for a user with the role ",
                                                   std::string(RoleName(join.role)),
                                                   "; use it with: rigcal login STRING"));
  }
  AgentConfig config;
  if (!flags.config.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(config, ReadAgentConfig(flags.config));
  }
  if (!flags.agent_id.empty()) config.agent_id = flags.agent_id;
  if (!join.name.empty() && !config.agent_id.empty() && join.name != config.agent_id) {
    return absl::InvalidArgumentError(absl::StrCat("the join string is for the agent ", join.name,
                                                   ", and this one is called ", config.agent_id));
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::filesystem::path directory, StateDirectory(flags, config));
  const IdentityFolder folder = IdentityFolder::OfAgent(directory);
  if (folder.Exists() && !flags.force) {
    return absl::AlreadyExistsError(
        absl::StrCat("this agent has joined a server already (", folder.path().string(),
                     "); --force puts the new identity in the place of the old one"));
  }
  RIGCAL_ASSIGN_OR_RETURN(
      const AgentState state,
      AgentState::Open(directory, join.name.empty() ? config.agent_id : join.name));
  RIGCAL_ASSIGN_OR_RETURN(
      const PeerIdentity identity,
      JoinSomewhere(flags, join, state.identity().agent_id, discovery.get(), dialog));
  RIGCAL_RETURN_IF_ERROR(folder.Replace(identity));
  out << "agent " << state.identity().agent_id << " has joined the server at "
      << (identity.grpc.empty() ? "?" : identity.grpc.front()) << "\nidentity in "
      << folder.path().string() << ", renewed by itself while the agent runs\n";
  // The service is started by who has installed it.
  if (flags.config != kServiceConfig) {
    out << "start it with: rigcal-agent" << StartFlags(flags) << "\n";
  }
  return absl::OkStatus();
}

}  // namespace

void AddJoinCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] = all->Add(
      app, "join",
      "Joins a server on another PC, once, with a join string of it; as root, for the service of "
      "the package",
      &JoinAsAgent);
  command.add_option("STRING", flags.join_string,
                     "What `rigcal token create` has printed on the server PC: rk1... Without it, "
                     "servers that announce themselves are listed");
  command.add_option("--server", flags.server,
                     "HOST:PORT of the server's HTTPS port, where it is not as the string says");
  command.add_option("--config", flags.config, "TOML file of the agent");
  command.add_option("--state-dir", flags.state_dir, "Folder of this agent alone, as for running");
  command.add_option("--agent-id", flags.agent_id, "Name of this agent");
  command.add_flag("--force", flags.force, "Also where it has joined already");
}

}  // namespace rigcal::agent
