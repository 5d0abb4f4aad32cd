// SPDX-License-Identifier: Apache-2.0
#include "client/commands/doctor_command.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "client/commands/bundle_facts.h"
#include "client/commands/redact.h"
#include "client/net/paging.h"
#include "client/output/quantities.h"
#include "common/wire/server_list.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

const char* LevelName(CheckLevel level) {
  return level == CheckLevel::kOk ? "ok" : level == CheckLevel::kWarn ? "warn" : "fail";
}

Check CannotAsk(std::string name, const absl::Status& status) {
  return {CheckLevel::kFail, std::move(name),
          absl::StrReplaceAll(std::string(status.message()), {{"\n", " "}})};
}

// All sessions; those that capture or drain with their cameras, which lists leave out.
absl::StatusOr<v1::ListSessionsResponse> ReadSessions(ServerConnection& server) {
  auto sessions = ReadAllPages(server, &v1::SessionService::Stub::ListSessions);
  if (!sessions.ok()) return sessions;
  for (v1::Session& session : *sessions->mutable_sessions()) {
    if (session.state() != v1::Session::STATE_CAPTURING &&
        session.state() != v1::Session::STATE_DRAINING) {
      continue;
    }
    v1::GetSessionRequest request;
    request.set_id(session.id());
    // One that has been deleted meanwhile stays as it was listed.
    const auto whole = server.Call(&v1::SessionService::Stub::GetSession, request);
    if (whole.ok()) session = whole->session();
  }
  return sessions;
}

// The checks of a server that has answered with `status`.
std::vector<Check> CheckServer(ServerConnection& server, const v1::GetStatusResponse& status) {
  std::vector<Check> checks = {
      {CheckLevel::kOk, "server", absl::StrCat("reachable at ", server.address())},
      CheckVersions(status)};
  const absl::StatusOr<std::string> health = server.CheckHealth();
  checks.push_back(health.ok() ? CheckHealthWord(*health) : CannotAsk("health", health.status()));
  checks.push_back(CheckIngest(status.ingest()));
  checks.push_back(CheckStore(status.store()));
  checks.push_back(CheckConnections(status.connections()));
  if (status.has_standby()) checks.push_back(CheckStandby(status.standby()));
  const auto agents = ReadAllPages(server, &v1::AgentService::Stub::ListAgents);
  checks.push_back(agents.ok() ? CheckAgents(*agents) : CannotAsk("agents", agents.status()));
  if (agents.ok()) {
    if (auto cameras = CheckOfferedCameras(*agents)) checks.push_back(*std::move(cameras));
    checks.push_back(CheckIntrinsics(*agents));
  }
  const auto sessions = ReadSessions(server);
  const double now_s = absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch());
  checks.push_back(sessions.ok() ? CheckSessions(*sessions, now_s)
                                 : CannotAsk("sessions", sessions.status()));
  return checks;
}

void AddConnectionChecks(const std::string& address, std::vector<Check>* checks) {
  const ConnectionFacts facts = GatherConnectionFacts(address);
  checks->push_back(ExplainConnection(facts));
  if (const std::optional<Check> clock = CheckClock(facts)) checks->push_back(*clock);
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
  auto lines = nlohmann::ordered_json::array();
  for (const Check& check : checks) {
    lines.push_back({{"name", check.name},
                     {"level", LevelName(check.level)},
                     {"message", check.message},
                     {"advice", check.advice}});
  }
  out << JsonText({{"server", server}, {"ok", ok}, {"checks", lines}}) << "\n";
}

std::string Report(const std::vector<Check>& checks) {
  std::ostringstream text;
  PrintTable(checks, text);
  return text.str();
}

constexpr char kReadMe[] =
    "Made by `rigcal doctor --bundle` for those who maintain rigcal.\n\n"
    "It holds versions, the doctor's report, configurations, the server's state, lines of the log\n"
    "and the space on disks. It holds no observations. Join strings, keys, passwords and tokens\n"
    "are removed. Names of PCs, users, cameras and sessions, addresses and paths are in it.\n"
    "Look at it before you give it away.\n";

// On `err`, so that the report alone stays on `out`.
absl::Status WriteBundle(const DoctorOptions& options, const std::vector<Check>& checks,
                         ServerConnection& server, Console& console) {
  std::vector<ExportFile> files = {{"README.txt", kReadMe},
                                   {"doctor.txt", Report(checks)},
                                   VersionsOfThisPc(),
                                   DisksOfThisPc(),
                                   LastLogLines()};
  for (ExportFile& file : Configurations(options.configs)) files.push_back(std::move(file));
  for (ExportFile& file : StateOfServer(server)) files.push_back(std::move(file));
  for (ExportFile& file : files) {
    file.name = "rigcal-bundle/" + Redact(file.name);
    file.content = Redact(file.content);
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::string archive, TarGzOf(files));
  RIGCAL_RETURN_IF_ERROR(CreatePrivateFile(options.bundle, archive));
  console.Message(absl::StrCat(options.bundle, " holds:"));
  for (const ExportFile& file : files) {
    console.err << "  " << Printable(file.name) << " (" << FormatBytes(file.content.size())
                << ")\n";
  }
  console.Message(absl::StrCat(
      "join strings, keys, passwords and tokens are removed; names of PCs and users, addresses and "
      "paths are not, and there are no observations. Look at it before you give it away: tar -xzf ",
      options.bundle));
  return absl::OkStatus();
}

}  // namespace

ExitCode RunDoctor(const DoctorOptions& options, CommandContext& context) {
  if (!options.server.empty()) {
    if (const absl::Status valid = wire::ServerList::Parse(options.server).status(); !valid.ok()) {
      context.Fail(valid);
      return ExitCode::kUsage;
    }
    context.server = options.server;
  }
  if (std::error_code error;
      !options.bundle.empty() &&
      std::filesystem::exists(std::filesystem::symlink_status(options.bundle, error))) {
    return context.Fail(
        absl::FailedPreconditionError(absl::StrCat("--bundle: ", options.bundle,
                                                   " exists already and is left as it is; name "
                                                   "another file, or remove it")));
  }
  ServerConnection server(context.server);
  const auto status = server.Call(&v1::StatusService::Stub::GetStatus, {});
  const std::optional<Check> agent_pc = CheckAgentPc(context.server, status.status());
  std::vector<Check> checks =
      status.ok() ? CheckServer(server, *status)
                  : std::vector{agent_pc.value_or(CannotAsk("server", status.status()))};
  if (UsesTls(server.address())) AddConnectionChecks(server.address(), &checks);
  for (Check& check : CheckIdentities()) checks.push_back(std::move(check));
  const bool ok = std::ranges::find(checks, CheckLevel::kFail, &Check::level) == checks.end();
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(server.address(), checks, ok, context.console.out);
  } else {
    PrintTable(checks, context.console.out);
  }
  if (!options.bundle.empty()) {
    const absl::Status written = WriteBundle(options, checks, server, context.console);
    if (!written.ok()) return context.Fail(written);
  }
  if (!status.ok() && !agent_pc) return ExitCodeOf(status.status());
  return ok ? ExitCode::kOk : ExitCode::kFailed;
}

}  // namespace rigcal::client
