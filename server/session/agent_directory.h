// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/agent.h"
#include "common/session/stream_audit.h"
#include "server/session/agent_link.h"

namespace rigcal::server {

struct AgentDirectoryOptions {
  size_t max_connected_agents = 256;
  size_t max_cameras_per_agent = 64;
  // Agents that have gone and are still listed; the ones gone longest are forgotten first.
  size_t max_remembered_agents = 256;
  // An agent that was heard within this time is there. Agents report every 10 s.
  std::chrono::milliseconds alive_for{25'000};
  // Streams whose last report is kept in memory.
  size_t max_stream_reports = 4096;
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock
  std::function<std::chrono::steady_clock::time_point()> now = std::chrono::steady_clock::now;
};

// The connected agents and their cameras. Thread-safe; calls links only with no lock held.
class AgentDirectory {
 public:
  // One successful Register; given back to Unregister. Never 0, never used twice.
  using Registration = uint64_t;

  // A camera with a live agent.
  struct ConnectedCamera {
    AnnouncedCamera camera;
    std::string agent_id;
    std::shared_ptr<AgentLink> link;
    Registration registration = 0;
    std::string rig = {};
  };

  // A live agent, which may have no camera yet.
  struct ConnectedAgent {
    std::string agent_id;
    std::string rig;
    std::shared_ptr<AgentLink> link;
    Registration registration = 0;
  };

  explicit AgentDirectory(AgentDirectoryOptions options = {});

  // Adds the agent, which has passed wire::FromProto. The same agent_id with a higher (incarnation,
  // connection) replaces its older stream, which is closed with ABORTED.
  //   INVALID_ARGUMENT    the same camera twice
  //   ABORTED             a newer stream of the same agent_id is connected; both are named
  //   ALREADY_EXISTS      a live agent with another agent_id, or another process or installation
  //                       with the same one, holds a camera; both and the camera are named. So is
  //                       one with the same agent_id and secret on another host or address, as
  //                       long as the first is there: a copy of its state folder
  //   RESOURCE_EXHAUSTED  too many agents, or too many cameras for one agent
  //   UNAVAILABLE         after CloseAll
  absl::StatusOr<Registration> Register(AgentRecord agent, std::shared_ptr<AgentLink> link);
  // True: the registration was current. False: a newer stream has replaced it, and nothing happens.
  bool Unregister(Registration registration);

  // Cameras of `rig` with a live agent, by name and rig. Empty `rig`: of every rig.
  std::vector<ConnectedCamera> ConnectedCameras(std::string_view rig) const;
  std::vector<std::string> ConnectedCameraNames(std::string_view rig) const;
  // None: it is not connected.
  std::optional<ConnectedAgent> FindAgent(std::string_view agent_id) const;
  // Connected and remembered ones, by agent_id. Empty `rig`: every rig.
  std::vector<AgentRecord> List(std::string_view rig) const;
  size_t ConnectedCount() const;
  // A sign of life. Of a registration that is not current any more: nothing happens.
  void SetSpool(Registration registration, SpoolStatus status);
  // What the agent of a stream last said about it: kept in memory, as it arrives, because a store
  // that is slow or full has an older one. Of at most AgentDirectoryOptions::max_stream_reports.
  void SetStreamReport(const StreamKey& stream, SpoolReport report);
  std::optional<SpoolReport> StreamReport(const StreamKey& stream) const;
  // The stream has ended, or is gone.
  void ForgetStreamReport(const StreamKey& stream);
  // kNone for an empty `agent_id`.
  StreamHolder HolderOf(std::string_view agent_id, const StreamKey& stream) const;

  // Closes every link with `reason` and accepts no agent from now on.
  void CloseAll(const absl::Status& reason);

 private:
  struct Entry {
    AgentRecord agent;
    std::shared_ptr<AgentLink> link;  // none: not connected
    Registration registration = 0;
    std::chrono::steady_clock::time_point heard = {};
  };

  absl::Status CheckCopy(const AgentRecord& agent, const Entry& connected) const;
  absl::Status CheckAgainstConnected(const AgentRecord& agent) const;
  void ForgetOldest();

  const AgentDirectoryOptions options_;
  mutable std::mutex mutex_;
  std::map<std::string, Entry, std::less<>> by_agent_id_;
  std::map<StreamKey, SpoolReport> stream_reports_;
  Registration last_registration_ = 0;
  size_t connected_count_ = 0;
  bool closed_ = false;
};

}  // namespace rigcal::server
