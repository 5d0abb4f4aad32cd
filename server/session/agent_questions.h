// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "server/session/agent_directory.h"

namespace rigcal::server {

// Calls of clients that wait for the answer of an agent; each holds a thread of the RPC server.
// Thread-safe.
template <typename Answer>
class AgentQuestions {
 public:
  // `noun`: "preview", for messages. `one_per_camera`: a second question about a camera is refused.
  AgentQuestions(std::string noun, size_t max_waiting, bool one_per_camera)
      : noun_(std::move(noun)), max_waiting_(max_waiting), one_per_camera_(one_per_camera) {}

  // The id of a question, for the request to the agent. Await must follow.
  // RESOURCE_EXHAUSTED: the camera is asked already, or too much is. UNAVAILABLE: after Shutdown.
  absl::StatusOr<uint32_t> Enter(const std::string& rig_and_camera,
                                 AgentDirectory::Registration registration) {
    const std::lock_guard lock(mutex_);
    if (shut_down_) return absl::UnavailableError("the server is shutting down");
    for (const auto& [id, waiting] : waiting_) {
      if (!one_per_camera_ || waiting.rig_and_camera != rig_and_camera) continue;
      return absl::ResourceExhaustedError(absl::StrCat("a ", noun_, " of camera '", rig_and_camera,
                                                       "' is under way; ask again when it is ",
                                                       "there"));
    }
    if (waiting_.size() >= max_waiting_) {
      return absl::ResourceExhaustedError(absl::StrCat(waiting_.size(), " ", noun_,
                                                       "s are under way, which is the limit; ask ",
                                                       "again in a moment"));
    }
    do {
      ++last_id_;
    } while (last_id_ == 0 || waiting_.contains(last_id_));
    waiting_[last_id_] = {
        .rig_and_camera = rig_and_camera, .registration = registration, .outcome = {}};
    return last_id_;
  }

  // `is_cancelled` is asked now and then.
  // ABORTED: no answer in time, or the agent disconnected. CANCELLED. UNAVAILABLE: Shutdown.
  absl::StatusOr<Answer> Await(uint32_t id, std::chrono::milliseconds longest,
                               const std::function<bool()>& is_cancelled) {
    const auto give_up = std::chrono::steady_clock::now() + longest;
    std::unique_lock lock(mutex_);
    Waiting& waiting = waiting_[id];
    absl::StatusOr<Answer> outcome =
        absl::AbortedError(absl::StrCat("the agent of camera '", waiting.rig_and_camera,
                                        "' did not answer within ", longest.count(), " ms"));
    while (!waiting.outcome && std::chrono::steady_clock::now() < give_up) {
      if (is_cancelled()) {
        outcome = absl::CancelledError(absl::StrCat("nobody waits for the ", noun_, " any more"));
        break;
      }
      const auto look_again = std::chrono::steady_clock::now() + kCancellationInterval;
      changed_.wait_until(lock, std::min(give_up, look_again));
    }
    if (waiting.outcome) outcome = *std::move(waiting.outcome);
    waiting_.erase(id);
    return outcome;
  }

  // One that nobody waits for, or from another agent than was asked, is dropped.
  void Take(AgentDirectory::Registration registration, uint32_t id, Answer answer) {
    const std::lock_guard lock(mutex_);
    const auto found = waiting_.find(id);
    if (found == waiting_.end() || found->second.registration != registration) return;
    if (!found->second.outcome) found->second.outcome = std::move(answer);
    changed_.notify_all();
  }

  void AgentGone(AgentDirectory::Registration registration) {
    const std::lock_guard lock(mutex_);
    for (auto& [id, waiting] : waiting_) {
      if (waiting.registration != registration || waiting.outcome) continue;
      waiting.outcome = absl::AbortedError(absl::StrCat(
          "the agent of camera '", waiting.rig_and_camera, "' disconnected before it answered"));
    }
    changed_.notify_all();
  }

  // Ends every wait.
  void Shutdown() {
    const std::lock_guard lock(mutex_);
    shut_down_ = true;
    for (auto& [id, waiting] : waiting_) {
      if (!waiting.outcome) waiting.outcome = absl::UnavailableError("the server is shutting down");
    }
    changed_.notify_all();
  }

 private:
  static constexpr std::chrono::milliseconds kCancellationInterval{250};

  struct Waiting {
    std::string rig_and_camera;
    AgentDirectory::Registration registration = 0;
    std::optional<absl::StatusOr<Answer>> outcome;
  };

  const std::string noun_;
  const size_t max_waiting_;
  const bool one_per_camera_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint32_t, Waiting> waiting_;  // by request id
  uint32_t last_id_ = 0;
  bool shut_down_ = false;
};

}  // namespace rigcal::server
