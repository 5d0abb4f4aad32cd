// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::bench {

// Agents of one camera each, hundreds of them in one process: their spool, their decisions what is
// sent next and their connection are those of rigcal-agent, and one thread serves them all, instead
// of several for each. They have no detectors, and send neither previews nor reports.
struct FleetOptions {
  std::string address;  // HOST:PORT, without TLS
  std::string session_id;
  int agents = 1;
  uint32_t rows_per_agent = 500;
  double rows_per_s = 50;  // of each agent
  // Their cameras see one after the other within their period; false: all at once, as with one
  // trigger.
  bool in_turn = false;
};

struct FleetResult {
  double duration_s = 0;  // from the first row until the last one is acknowledged
  uint64_t rows = 0;
  uint64_t messages = 0;    // of rows
  double client_cpu_s = 0;  // of this process
  // From the moment at which a row should be there until it is acknowledged, so including what it
  // waits for others in the agent, and what the agent is late; ascending.
  std::vector<double> row_latency_s;
  // Per message, from its write to its acknowledgement; ascending.
  std::vector<double> ack_latency_s;
};

// Connects all agents; then `start` starts the session, and they begin once all know of it.
absl::StatusOr<FleetResult> RunFleet(const FleetOptions& options,
                                     const std::function<absl::Status()>& start);

}  // namespace rigcal::bench
