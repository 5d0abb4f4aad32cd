// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/server_context.h>

#include <chrono>
#include <functional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/session/change_notifier.h"

namespace rigcal::server {

// Calls `write` at once and after each change, at most 5 times a second, until it returns true (the
// resource has ended), fails, or the client goes (CANCELLED). UNAVAILABLE: the server shuts down.
inline absl::Status RunWatch(const grpc::ServerContext& context, ChangeNotifier::Watch* watch,
                             const std::function<absl::StatusOr<bool>()>& write) {
  // How soon a client that has gone is noticed while nothing changes.
  constexpr std::chrono::milliseconds kCancellationCheck(500);
  constexpr std::chrono::milliseconds kShortestInterval(200);
  while (!context.IsCancelled()) {
    const ChangeNotifier::Event event = watch->Wait(kCancellationCheck);
    if (event == ChangeNotifier::Event::kTimeout) continue;
    if (event == ChangeNotifier::Event::kShutdown) break;
    const absl::StatusOr<bool> ended = write();
    if (!ended.ok()) return ended.status();
    if (*ended) return absl::OkStatus();
    if (!watch->Pause(kShortestInterval)) break;
  }
  if (context.IsCancelled()) return absl::CancelledError("the client has gone");
  return absl::UnavailableError("the server is shutting down; watch again after a moment");
}

}  // namespace rigcal::server
