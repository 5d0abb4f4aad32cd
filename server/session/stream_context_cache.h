// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/session.h"
#include "server/ingest/batch_validation.h"

namespace rigcal::server {

// The part of every session that ingest needs for each delivery, in memory. Also counts who reads a
// session, so that it is not deleted under a reader. Thread-safe; never touches the disk.
class StreamContextCache {
 public:
  // Adds or replaces a session.
  void Put(const Session& session);
  size_t size() const;

  // NOT_FOUND: no such session, or no such camera in it. FAILED_PRECONDITION: not started.
  absl::StatusOr<StreamContext> GetStreamContext(const StreamKey& stream) const;

  // Who may write to a stream, whichever way a delivery comes: the agent that the camera takes part
  // with; for a camera that was described by hand, whoever is no agent. `agent_id` empty: no agent.
  // `rig`: of the agent; empty where it has not said so. OK also for a session or camera that is
  // not known: GetStreamContext says so.
  // PERMISSION_DENIED: the session is of another rig, or the camera took part with another agent;
  // all are named.
  absl::Status CheckAgent(const StreamKey& stream, std::string_view agent_id,
                          std::string_view rig) const;

  // Which agent delivers a stream's camera, and in which rig. None: nobody, or not known.
  struct Owner {
    std::string rig;
    std::string agent_id;
  };
  std::optional<Owner> FindOwner(const StreamKey& stream) const;

  // NOT_FOUND: no such session.
  absl::Status AddReader(std::string_view session_id);
  void RemoveReader(std::string_view session_id);
  // Removes the session, so that no reading or delivery begins. NOT_FOUND.
  // FAILED_PRECONDITION: somebody is reading it.
  absl::Status Remove(std::string_view session_id);

 private:
  struct Camera {
    ImageSize image_size_px;
    std::string agent_id;
  };
  struct Entry {
    std::string rig;
    SessionState state = SessionState::kCreated;
    int marker_count = 0;
    std::map<std::string, Camera, std::less<>> cameras;
    int reader_count = 0;
  };

  mutable std::mutex mutex_;
  std::map<std::string, Entry, std::less<>> sessions_;
};

}  // namespace rigcal::server
