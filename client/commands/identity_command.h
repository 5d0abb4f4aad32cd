// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"

namespace rigcal::client {

struct CreateTokenOptions {
  std::string role = "agent";
  double ttl_s = 3600;
  std::string name;
};

// `rigcal token create`: prints a join string, and nothing else on stdout. For people, stderr has
// the links that open the dashboard with it.
ExitCode CreateToken(const CreateTokenOptions& options, CommandContext& context);
// `rigcal token list`: join strings, without their secrets.
ExitCode ListTokens(CommandContext& context);
// `rigcal token revoke`: the join string, and who joined with it.
ExitCode RevokeToken(const std::string& id, CommandContext& context);
// `rigcal agent forget`: no certificate of this agent is accepted any more.
ExitCode ForgetAgent(const std::string& name, CommandContext& context);

struct LoginOptions {
  std::string join_string;
  std::string name;  // empty: that of the join string, else the user's and this PC's
};

// `rigcal login`: this user's identity, from a join string.
ExitCode Login(const LoginOptions& options, CommandContext& context);

}  // namespace rigcal::client
