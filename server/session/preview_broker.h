// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/session/preview.h"
#include "server/session/agent_directory.h"

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
  PreviewBroker(PreviewBrokerOptions options, const AgentDirectory* directory);

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
  void AgentGone(AgentDirectory::Registration registration);
  // Ends every wait.
  void Shutdown();

 private:
  struct Waiting {
    std::string rig_and_camera;
    AgentDirectory::Registration registration = 0;
    std::optional<absl::StatusOr<Preview>> outcome;
  };

  absl::StatusOr<AgentDirectory::ConnectedCamera> Find(const std::string& rig,
                                                       const std::string& camera) const;
  absl::StatusOr<uint32_t> Enter(const std::string& rig, const std::string& camera,
                                 AgentDirectory::Registration registration);
  absl::StatusOr<Preview> Await(uint32_t id, std::chrono::milliseconds longest,
                                const std::function<bool()>& is_cancelled);

  const PreviewBrokerOptions options_;
  const AgentDirectory& directory_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint32_t, Waiting> waiting_;  // by request id
  uint32_t last_id_ = 0;
  bool shut_down_ = false;
};

}  // namespace rigcal::server
