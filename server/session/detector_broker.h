// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "common/session/detector.h"
#include "server/session/agent_directory.h"
#include "server/session/agent_questions.h"

namespace rigcal::server {

struct DetectorBrokerOptions {
  // Calls that wait for an agent, of all cameras.
  size_t max_waiting = 32;
  std::chrono::milliseconds longest_wait{10'000};
};

// Passes what clients ask of detectors on to agents. Thread-safe.
class DetectorBroker {
 public:
  struct CameraDetector {
    std::string agent_id;
    std::string rig;
    DetectorState state;
  };

  // The directory outlives the broker.
  DetectorBroker(DetectorBrokerOptions options, const AgentDirectory* directory)
      : options_(options), directory_(*directory) {}

  // Sends `request`, whose id is set here, to the agent of its camera, and returns its answer.
  //   INVALID_ARGUMENT     no camera, or it is in several rigs; in the agent's words: a value
  //   NOT_FOUND            no agent has announced it; names those that are connected
  //   FAILED_PRECONDITION  its agent is away; in the agent's words: not now, not with this camera
  //   RESOURCE_EXHAUSTED   too much is asked
  //   ABORTED              no answer in time, as of an agent of an earlier release
  //   INTERNAL             in the agent's words: it could not be done
  //   CANCELLED            is_cancelled
  //   UNAVAILABLE          after Shutdown
  absl::StatusOr<CameraDetector> Ask(const std::string& rig, DetectorRequest request,
                                     const std::function<bool()>& is_cancelled);

  // What an agent answers; one that nobody waits for, or from another agent than was asked, is
  // dropped.
  void TakeAnswer(AgentDirectory::Registration registration, DetectorAnswer answer) {
    const uint32_t id = answer.request_id;
    questions_.Take(registration, id, std::move(answer));
  }
  void AgentGone(AgentDirectory::Registration registration) { questions_.AgentGone(registration); }
  // Ends every wait.
  void Shutdown() { questions_.Shutdown(); }

 private:
  const DetectorBrokerOptions options_;
  const AgentDirectory& directory_;
  AgentQuestions<DetectorAnswer> questions_{"question", options_.max_waiting, false};
};

}  // namespace rigcal::server
