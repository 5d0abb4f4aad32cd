// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "server/ingest/ingest.h"
#include "server/metrics/solve_times.h"
#include "server/session/agent_directory.h"
#include "server/session/calibration_runner.h"
#include "server/session/session_coordinator.h"
#include "server/store/store.h"

namespace rigcal::server {

// Connections to one of the ports.
struct PortCounts {
  uint64_t open = 0;
  uint64_t accepted = 0;
  uint64_t refused = 0;
};

// Counts of the HTTP port's requests.
struct WebCounts {
  PortCounts connections;
  uint64_t requests = 0;
  uint64_t refused_requests = 0;
};

// Where the figures come from; all outlive whoever asks.
struct MetricsSources {
  const Store* store = nullptr;
  const Ingest* ingest = nullptr;
  const AgentDirectory* directory = nullptr;
  const SessionCoordinator* coordinator = nullptr;
  const CalibrationRunner* runner = nullptr;
  const SolveTimes* solves = nullptr;
  std::function<PortCounts()> grpc;
  std::function<WebCounts()> web;
  std::string software_version;
};

// What a standby knows of itself.
struct StandbyFigures {
  std::string primary;        // HOST:PORT
  bool complete = false;      // it had everything of the primary once
  uint64_t behind_count = 0;  // rows that the primary had more, when it last answered
  double silence_s = -1;      // since then; below 0: it never has
  bool follows = false;       // the last attempt to copy has worked
};
std::string StandbyMetricsText(const StandbyFigures& figures);

// The state of the server in the text format of Prometheus (version 0.0.4). Names begin with
// "rigcal_", those of the process with "process_".
std::string MetricsText(const MetricsSources& sources);

}  // namespace rigcal::server
