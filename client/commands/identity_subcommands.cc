// SPDX-License-Identifier: Apache-2.0
#include "absl/strings/numbers.h"
#include "absl/time/time.h"
#include "client/commands/command_parser.h"
#include "client/commands/identity_command.h"

namespace rigcal::client {
namespace {

// "90s", "1h", "1h30m", "7d".
absl::StatusOr<double> ParseTtl(const std::string& text) {
  absl::Duration ttl;
  double days = 0;
  const bool in_days =
      text.ends_with('d') && absl::SimpleAtod(text.substr(0, text.size() - 1), &days);
  if (in_days) ttl = absl::Hours(24 * days);
  if ((in_days || absl::ParseDuration(text, &ttl)) && ttl >= absl::Seconds(1) &&
      ttl <= absl::Hours(24 * 30)) {
    return absl::ToDoubleSeconds(ttl);
  }
  return absl::InvalidArgumentError("wants a time from 1s to 30d, such as 30m, 1h or 7d");
}

}  // namespace

void AddIdentityCommands(CommandParser& parser) {
  CLI::App* const group = parser.AddGroup(
      "token", "Join strings, with which agents and users on other PCs join this server");
  {
    auto [app, options] = parser.AddCommand(
        group, "create", "Print a join string, which can be used once", CreateToken);
    AddOption(app, "--role", "agent|operator|viewer", &options->role,
              "What who joins may do: write its own cameras, everything but identities, or read; "
              "without it agent")
        ->check(CLI::IsMember({"agent", "operator", "viewer"}).description(""));
    AddParsedOption(app, "--ttl", "TIME", &options->ttl_s, ParseTtl,
                    "How long it can be used, such as 30m, 1h or 7d; without it 1h");
    AddOption(app, "--name", "NAME", &options->name,
              "Name of the agent or user; replaces an earlier one of that name. Without it a "
              "new name is chosen");
  }
  parser.AddCommand(group, "list", "List the join strings that were made, without their secrets",
                    ListTokens);
  {
    auto [app, id] = parser.AddCommand(
        group, "revoke", "Make a join string useless, and refuse who has joined with it",
        RevokeToken);
    AddArgument(app, "ID", "Id of the token, as `rigcal token list` shows it", id);
  }
  auto [app, options] = parser.AddCommand(
      nullptr, "login", "Join a server on another PC as a user, with a join string of it", Login,
      /*asks_server=*/false);
  AddArgument(app, "STRING", "What `rigcal token create --role operator` has printed: rk1....",
              &options->join_string);
  AddOption(app, "--name", "NAME", &options->name,
            "Name of the user; without it from the user's name and this PC's");
}

}  // namespace rigcal::client
