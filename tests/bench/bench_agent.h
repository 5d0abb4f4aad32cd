// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/security/credentials.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/simulation/world/simulated_world.h"
#include "rigcal/v1/ingest_service.pb.h"

namespace rigcal::bench {

// A load of synthetic agents, each with one camera and one stream of its own.
struct LoadOptions {
  std::string address;
  std::string session_id;
  int agents = 1;
  int rows_per_message = 16;
  uint32_t rows_per_agent = 100'000;
  double rows_per_s = 0;  // of each agent; 0: as fast as credits allow
  uint32_t window = 32768;
  // Of one agent; unset: none.
  std::function<std::shared_ptr<grpc::ChannelCredentials>(const std::string& agent_id)>
      credentials = {};
  // Agent i has camera i of this world, and delivers what that sees; null: made up rows.
  const SimulatedWorld* world = nullptr;
  // Answers requests for previews with this image; empty: there are none.
  std::string preview_jpeg = {};
};

// A message of observations that is on the server's disk.
struct Acknowledged {
  uint32_t last_seq = 0;
  std::chrono::steady_clock::time_point time;  // when the acknowledgement arrived
};

struct LoadResult {
  double duration_s = 0;
  uint64_t rows = 0;
  // Per message, from its write to its acknowledgement; ascending.
  std::vector<double> ack_latency_s;
  std::vector<std::vector<Acknowledged>> acknowledged;  // by agent, in the order of arrival
};

// Opens the streams first; `start` is called after every hello (it starts the session).
absl::StatusOr<LoadResult> RunLoad(const LoadOptions& options,
                                   const std::function<absl::Status()>& start);

// What a made up agent says of itself: one camera without pending streams.
v1::ConnectRequest BenchHello(int agent);
// Rows of a made up camera, as its agent sends them; without a session.
v1::ConnectRequest BenchBatch(int agent, int rows);
// "bench-agent-<agent>".
std::string BenchAgentId(int agent);
// "bench_<agent>".
std::string BenchCameraName(int agent);

}  // namespace rigcal::bench
