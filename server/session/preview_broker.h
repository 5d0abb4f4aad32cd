// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "common/session/preview.h"
#include "server/session/agent_directory.h"
#include "server/session/agent_questions.h"

namespace rigcal::server {

struct PreviewBrokerOptions {
  // Previews that are waited for, of all cameras; each holds a thread of the RPC server.
  size_t max_waiting = 16;
  std::chrono::milliseconds default_wait{5'000};
  std::chrono::milliseconds longest_wait{30'000};
  // For the answer to arrive, beyond the time the agent waits for a frame.
  std::chrono::milliseconds answer_grace{2'000};
  uint32_t max_jpeg_bytes = 1u << 20;
};

// Gets previews from agents for the clients that ask for them. Thread-safe.
class PreviewBroker {
 public:
  struct CameraPreview {
    std::string agent_id;
    std::string rig;
    Preview preview;  // without a refusal
  };

  // The directory outlives the broker.
  PreviewBroker(PreviewBrokerOptions options, const AgentDirectory* directory)
      : options_(options), directory_(*directory) {}

  // Waits for the next frame of the camera; `wait` 0: the default. `rig` empty: the one that has
  // the camera. `is_cancelled` is asked now and then.
  //   INVALID_ARGUMENT     no camera, too long a wait, or the camera is in several rigs
  //   NOT_FOUND            no agent has announced it; names those that are connected
  //   FAILED_PRECONDITION  its agent is away or too old; or, in the agent's words: previews are
  //                        off, there are no frames, the camera does not capture
  //   RESOURCE_EXHAUSTED   the camera is asked already, or too much is; in the agent's words: too
  //                        often
  //   ABORTED              no frame or no answer in time, or the agent disconnected
  //   INTERNAL             the agent could not make it
  //   CANCELLED            is_cancelled
  //   UNAVAILABLE          after Shutdown
  absl::StatusOr<CameraPreview> Get(const std::string& rig, const std::string& camera,
                                    std::chrono::milliseconds wait,
                                    const std::function<bool()>& is_cancelled);

  // What an agent answers; one that nobody waits for, or from another agent than was asked, is
  // dropped.
  void TakeAnswer(AgentDirectory::Registration registration, Preview preview);
  void AgentGone(AgentDirectory::Registration registration) { questions_.AgentGone(registration); }
  // Ends every wait.
  void Shutdown() { questions_.Shutdown(); }

 private:
  const PreviewBrokerOptions options_;
  const AgentDirectory& directory_;
  AgentQuestions<Preview> questions_{"preview", options_.max_waiting, true};
};

}  // namespace rigcal::server
