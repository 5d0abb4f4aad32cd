// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/support/status.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <exception>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "common/wire/grpc_status.h"

namespace rigcal::server {

// Calls that are being answered in this process, for a shutdown that waits for them and for nothing
// else: an idle connection is no reason to wait.
inline std::atomic<int> calls_in_flight = 0;

// Runs the body of an RPC and turns what it returns, or throws, into the status of the call.
template <typename Body>
grpc::Status GuardedCall(const char* rpc, Body&& body) {
  struct InFlight {
    InFlight() { ++calls_in_flight; }
    ~InFlight() { --calls_in_flight; }
  };
  const InFlight in_flight;
  try {
    const absl::Status status = std::forward<Body>(body)();
    if (absl::IsInternal(status) || absl::IsDataLoss(status)) {
      spdlog::error("{}: {}", rpc, std::string(status.message()));
    }
    return wire::ToGrpc(status);
  } catch (const std::exception& error) {
    spdlog::error("{}: an unexpected fault: {}", rpc, error.what());
    return {grpc::StatusCode::INTERNAL, std::string("an unexpected fault: ") + error.what()};
  }
}

}  // namespace rigcal::server
