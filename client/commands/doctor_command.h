// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"
#include "rigcal/v1/agent_service.pb.h"
#include "rigcal/v1/session_service.pb.h"
#include "rigcal/v1/status_service.pb.h"

namespace rigcal::client {

enum class CheckLevel { kOk, kWarn, kFail };

// One line of the doctor's findings.
struct Check {
  CheckLevel level = CheckLevel::kOk;
  std::string name;
  std::string message;
  std::string advice = {};  // what to do; empty where nothing is wrong
};

// `rigcal doctor`: kServerUnreachable where there is no server, kFailed where a check fails; a
// warning is no failure.
ExitCode RunDoctor(CommandContext& context);

// The checks, each for itself.
Check CheckVersions(const rigcal::v1::GetStatusResponse& status);
Check CheckHealthWord(const std::string& word);
Check CheckIngest(const rigcal::v1::IngestStatus& ingest);
Check CheckDisk(const rigcal::v1::StoreStatus& store);
Check CheckAgents(const rigcal::v1::ListAgentsResponse& agents);
Check CheckIntrinsics(const rigcal::v1::ListAgentsResponse& agents);
// `now_s`: seconds since 1970, UTC.
Check CheckSessions(const rigcal::v1::ListSessionsResponse& sessions, double now_s);

}  // namespace rigcal::client
