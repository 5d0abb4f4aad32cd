// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/security/credentials.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

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
};

struct LoadResult {
  double duration_s = 0;
  uint64_t rows = 0;
  // Per message, from its write to its acknowledgement; ascending.
  std::vector<double> ack_latency_s;
};

// Opens the streams first; `start` is called after every hello (it starts the session).
absl::StatusOr<LoadResult> RunLoad(const LoadOptions& options,
                                   const std::function<absl::Status()>& start);

// "bench-agent-<agent>".
std::string BenchAgentId(int agent);
// "bench_<agent>".
std::string BenchCameraName(int agent);

}  // namespace rigcal::bench
