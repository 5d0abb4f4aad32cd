// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <functional>
#include <thread>

#include "absl/status/status.h"

namespace rigcal::client {

struct PollOptions {
  std::chrono::milliseconds interval{200};
  // How long the server may be away (a restart) before UNAVAILABLE is returned.
  std::chrono::milliseconds patience{30'000};
  // Called between two questions, waits `interval`; an error ends the polling with it.
  std::function<absl::Status(std::chrono::milliseconds)> wait = [](std::chrono::milliseconds time) {
    std::this_thread::sleep_for(time);
    return absl::OkStatus();
  };
};

// Asks a server that has answered before, with `get`, until `done` says so of the answer, and
// returns that answer as a StatusOr.
template <typename Get, typename Done>
auto PollUntil(const Get& get, const Done& done, const PollOptions& options) -> decltype(get()) {
  auto last_answer = std::chrono::steady_clock::now();
  while (true) {
    auto answer = get();
    const auto now = std::chrono::steady_clock::now();
    if (answer.ok()) {
      if (done(*answer)) return answer;
      last_answer = now;
    } else if (!absl::IsUnavailable(answer.status()) || now - last_answer > options.patience) {
      return answer;
    }
    if (absl::Status status = options.wait(options.interval); !status.ok()) return status;
  }
}

}  // namespace rigcal::client
