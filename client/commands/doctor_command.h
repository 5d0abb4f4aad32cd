// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "client/commands/command_context.h"
#include "common/enrolment/tls_probe.h"
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

struct DoctorOptions {
  std::string server;  // HOST:PORT; empty: that of --server
  std::string bundle;  // FILE.tar.gz with the report and what else a maintainer needs; empty: none
  std::vector<std::string> configs;  // files that go into it; empty: those in /etc/rigcal
};

// `rigcal doctor`: kServerUnreachable where there is no server, kFailed where a check fails; a
// warning is no failure. A bundle that cannot be written is kFailed.
ExitCode RunDoctor(const DoctorOptions& options, CommandContext& context);

// What the doctor finds out about a connection that fails, or that is to another PC.
struct ConnectionFacts {
  std::string address;
  bool has_identity = false;
  absl::Status identity_fault = absl::OkStatus();  // this user has one that cannot be used
  TlsProbe probe = {};
  std::optional<absl::Time> own_end = {};          // of this user's certificate
  std::optional<absl::Duration> clock_ahead = {};  // of this PC, against the server
  absl::Status renewal = absl::OkStatus();         // what the server said to a renewal
};
// The server is on another PC, or this user has joined it.
bool UsesTls(const std::string& address);
ConnectionFacts GatherConnectionFacts(const std::string& address);

// The identities that this user and his agents have on this PC: whether they can be used, and, of
// an agent, whether its server takes it. Asks the servers.
std::vector<Check> CheckIdentities();
// A PC whose agents have joined a server, and whose user has not: that none answers at `address`,
// on this PC, is no fault. Unset: another case.
std::optional<Check> CheckAgentPc(const std::string& address, const absl::Status& status);

// The checks, each for itself.
Check ExplainConnection(const ConnectionFacts& facts);
// Unset: the server's clock is not known.
std::optional<Check> CheckClock(const ConnectionFacts& facts);
Check CheckVersions(const rigcal::v1::GetStatusResponse& status);
Check CheckHealthWord(const std::string& word);
Check CheckIngest(const rigcal::v1::IngestStatus& ingest);
// Of the server that follows this one.
Check CheckStandby(const rigcal::v1::StandbyStatus& standby);
Check CheckConnections(const rigcal::v1::ConnectionStatus& connections);
Check CheckStore(const rigcal::v1::StoreStatus& store);
Check CheckAgents(const rigcal::v1::ListAgentsResponse& agents);
// Cameras that agents see or have chosen. None: nothing is offered.
std::optional<Check> CheckOfferedCameras(const rigcal::v1::ListAgentsResponse& agents);
Check CheckIntrinsics(const rigcal::v1::ListAgentsResponse& agents);
// `now_s`: seconds since 1970, UTC.
Check CheckSessions(const rigcal::v1::ListSessionsResponse& sessions, double now_s);

}  // namespace rigcal::client
