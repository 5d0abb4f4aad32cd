// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <thread>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::client {

struct PollOptions {
  std::chrono::milliseconds interval{200};
  // How long a server that has answered before may be away (a restart) before UNAVAILABLE is
  // returned.
  std::chrono::milliseconds patience{30'000};
  // The server has answered before the first question.
  bool answered_before = false;
  // Called between two questions, waits `interval`; an error ends the polling with it. Empty: just
  // waits.
  std::function<absl::Status(std::chrono::milliseconds)> wait;
  // Told once when the server has gone away. May be empty.
  std::function<void(const absl::Status&)> on_lost;
};

// Asks with `get` until `done` says so of the answer, and returns that answer.
template <typename T>
absl::StatusOr<T> PollUntil(const std::function<absl::StatusOr<T>()>& get,
                            const std::function<bool(const T&)>& done, const PollOptions& options) {
  std::optional<std::chrono::steady_clock::time_point> last_answer;
  if (options.answered_before) last_answer = std::chrono::steady_clock::now();
  bool lost = false;
  while (true) {
    absl::StatusOr<T> answer = get();
    const auto now = std::chrono::steady_clock::now();
    if (answer.ok()) {
      if (done(*answer)) return answer;
      last_answer = now;
      lost = false;
    } else if (!absl::IsUnavailable(answer.status()) || !last_answer.has_value() ||
               now - *last_answer > options.patience) {
      return answer.status();
    } else if (!std::exchange(lost, true) && options.on_lost) {
      options.on_lost(answer.status());
    }
    if (options.wait) {
      if (absl::Status status = options.wait(options.interval); !status.ok()) return status;
    } else {
      std::this_thread::sleep_for(options.interval);
    }
  }
}

}  // namespace rigcal::client
