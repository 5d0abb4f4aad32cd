// SPDX-License-Identifier: Apache-2.0
#include "client/commands/doctor_command.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "client/commands/agent_command.h"
#include "client/commands/session_command.h"
#include "client/net/server_connection.h"

namespace rigcal::client {
namespace {

const char* LevelName(CheckLevel level) {
  switch (level) {
    case CheckLevel::kOk:
      return "ok";
    case CheckLevel::kWarn:
      return "warn";
    case CheckLevel::kFail:
      break;
  }
  return "fail";
}

Check CannotAsk(std::string name, const absl::Status& status) {
  return {CheckLevel::kFail, std::move(name), std::string(status.message()), ""};
}

Check HealthCheck(ServerConnection& server) {
  const absl::StatusOr<std::string> word = server.CheckHealth();
  return word.ok() ? CheckHealthWord(*word) : CannotAsk("health", word.status());
}

std::vector<Check> AgentChecks(ServerConnection& server) {
  const auto agents = ReadAllAgents(server, {});
  if (!agents.ok()) return {CannotAsk("agents", agents.status())};
  return {CheckAgents(*agents), CheckIntrinsics(*agents)};
}

Check SessionCheck(ServerConnection& server) {
  const auto sessions = ReadAllSessions(server, {});
  if (!sessions.ok()) return CannotAsk("sessions", sessions.status());
  return CheckSessions(*sessions, absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch()));
}

void PrintTable(const std::vector<Check>& checks, std::ostream& out) {
  size_t width = 0;
  for (const Check& check : checks) width = std::max(width, check.name.size());
  for (const Check& check : checks) {
    const std::string level = LevelName(check.level);
    out << level << std::string(6 - level.size(), ' ') << check.name
        << std::string(width + 2 - check.name.size(), ' ') << Printable(check.message) << "\n";
    if (!check.advice.empty()) out << std::string(width + 8, ' ') << "-> " << check.advice << "\n";
  }
}

void PrintJson(const std::string& server, const std::vector<Check>& checks, bool ok,
               std::ostream& out) {
  using Json = nlohmann::ordered_json;
  Json lines = Json::array();
  for (const Check& check : checks) {
    lines.push_back({{"name", check.name},
                     {"level", LevelName(check.level)},
                     {"message", check.message},
                     {"advice", check.advice}});
  }
  const Json json = {{"server", server}, {"ok", ok}, {"checks", lines}};
  out << json.dump(1, ' ', false, Json::error_handler_t::replace) << "\n";
}

}  // namespace

ExitCode RunDoctor(CommandContext& context) {
  ServerConnection server(context.server);
  std::vector<Check> checks;
  ExitCode code = ExitCode::kOk;
  const auto status = server.Call(server.status(), &v1::StatusService::Stub::GetStatus, {});
  if (status.ok()) {
    checks.push_back(
        {CheckLevel::kOk, "server", absl::StrCat("reachable at ", server.address()), ""});
    checks.push_back(CheckVersions(*status));
    checks.push_back(HealthCheck(server));
    checks.push_back(CheckIngest(status->ingest()));
    checks.push_back(CheckDisk(status->store()));
    for (Check& check : AgentChecks(server)) checks.push_back(std::move(check));
    checks.push_back(SessionCheck(server));
  } else {
    checks.push_back(CannotAsk("server", status.status()));
    code = ExitCodeOf(status.status());
  }

  const bool ok = std::none_of(checks.begin(), checks.end(),
                               [](const Check& check) { return check.level == CheckLevel::kFail; });
  if (!ok && code == ExitCode::kOk) code = ExitCode::kFailed;
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(server.address(), checks, ok, context.console.out);
  } else {
    PrintTable(checks, context.console.out);
  }
  return code;
}

}  // namespace rigcal::client
