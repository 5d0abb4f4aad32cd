// SPDX-License-Identifier: Apache-2.0
#include "server/session/agent_directory.h"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

std::string Describe(const AgentRecord& agent) {
  return absl::StrCat("agent '", agent.agent_id, "' on host '", agent.host, "' (",
                      agent.address.empty() ? "" : absl::StrCat(agent.address, ", "),
                      "incarnation ", agent.incarnation, ", connection ", agent.connection, ")");
}

absl::Status CheckAnnouncement(const AgentRecord& agent, size_t max_cameras) {
  if (agent.cameras.size() > max_cameras) {
    return absl::ResourceExhaustedError(absl::StrCat(
        Describe(agent), " announces ", agent.cameras.size(), " cameras; at most ", max_cameras,
        " are allowed for one agent: run several agents, or raise limits.max_cameras_per_agent"));
  }
  std::set<std::string_view> names;
  for (const AnnouncedCamera& camera : agent.cameras) {
    if (!names.insert(camera.description.camera).second) {
      return absl::InvalidArgumentError(absl::StrCat(Describe(agent), " announces the camera '",
                                                     camera.description.camera, "' twice"));
    }
  }
  return absl::OkStatus();
}

const AnnouncedCamera* FindCamera(const AgentRecord& agent, std::string_view camera) {
  const auto found = std::find_if(
      agent.cameras.begin(), agent.cameras.end(),
      [&](const AnnouncedCamera& candidate) { return candidate.description.camera == camera; });
  return found == agent.cameras.end() ? nullptr : &*found;
}

}  // namespace

AgentDirectory::AgentDirectory(AgentDirectoryOptions options) : options_(std::move(options)) {}

// Two PCs with copies of one state folder have the same secret and certificate, and the incarnation
// says only which was started more often.
absl::Status AgentDirectory::CheckCopy(const AgentRecord& agent, const Entry& connected) const {
  const AgentRecord& other = connected.agent;
  const bool same_place =
      agent.host == other.host &&
      (agent.address == other.address || agent.address.empty() || other.address.empty());
  const auto silent_for = options_.now() - connected.heard;
  if (same_place || silent_for >= options_.alive_for) return absl::OkStatus();
  return absl::AlreadyExistsError(absl::StrCat(
      Describe(agent), " is refused: ", Describe(other),
      " is connected with the same id and secret. If one of them has a copy of the other's state "
      "folder, give it a state folder and --agent-id of its own, and let it join; if the agent has "
      "moved, stop it at its old place, or wait ",
      std::chrono::duration_cast<std::chrono::seconds>(options_.alive_for).count(), " s"));
}

absl::Status AgentDirectory::CheckAgainstConnected(const AgentRecord& agent) const {
  const auto own = by_agent_id_.find(agent.agent_id);
  const bool replaces = own != by_agent_id_.end() && own->second.link != nullptr;
  if (replaces) {
    const AgentRecord& other = own->second.agent;
    if (agent.credential != other.credential) {
      return absl::AlreadyExistsError(absl::StrCat(
          Describe(agent), " is refused: ", Describe(other),
          " is connected with the same id, and is another installation; give each agent its own ",
          "state directory and --agent-id"));
    }
    RIGCAL_RETURN_IF_ERROR(CheckCopy(agent, own->second));
    const auto now = std::tie(agent.incarnation, agent.connection);
    const auto before = std::tie(other.incarnation, other.connection);
    if (now < before) {
      return absl::AbortedError(absl::StrCat(Describe(agent), " is refused: the newer ",
                                             Describe(other), " is connected"));
    }
    if (now == before) {
      return absl::AlreadyExistsError(
          absl::StrCat(Describe(agent), " is refused: ", Describe(other),
                       " is connected with the same id; give each agent its own state directory"));
    }
  } else if (connected_count_ >= options_.max_connected_agents) {
    return absl::ResourceExhaustedError(absl::StrCat(
        Describe(agent), " is refused: ", connected_count_,
        " agents are connected, which is the limit; raise limits.max_agents on the server"));
  }
  for (const auto& [agent_id, entry] : by_agent_id_) {
    if (!entry.link || agent_id == agent.agent_id || entry.agent.rig != agent.rig) continue;
    for (const AnnouncedCamera& camera : agent.cameras) {
      if (FindCamera(entry.agent, camera.description.camera) == nullptr) continue;
      return absl::AlreadyExistsError(
          absl::StrCat("camera '", agent.rig, "/", camera.description.camera, "' is announced by ",
                       Describe(agent), " but held by ", Describe(entry.agent),
                       "; stop one of the two, or give the camera another name"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<AgentDirectory::Registration> AgentDirectory::Register(
    AgentRecord agent, std::shared_ptr<AgentLink> link) {
  RIGCAL_RETURN_IF_ERROR(CheckAnnouncement(agent, options_.max_cameras_per_agent));
  std::shared_ptr<AgentLink> fenced;
  std::string fenced_name;
  const std::string name = Describe(agent);
  Registration registration = 0;
  {
    std::lock_guard lock(mutex_);
    if (closed_) return absl::UnavailableError("the server is shutting down");
    RIGCAL_RETURN_IF_ERROR(CheckAgainstConnected(agent));
    agent.connected = true;
    agent.connect_utc_ns = UtcNowNs(options_.utc_now_ns);
    agent.disconnect_utc_ns = 0;
    Entry& entry = by_agent_id_[agent.agent_id];
    if (entry.link) {
      fenced = std::move(entry.link);
      fenced_name = Describe(entry.agent);
    } else {
      ++connected_count_;
    }
    registration = ++last_registration_;
    entry = {.agent = std::move(agent),
             .link = std::move(link),
             .registration = registration,
             .heard = options_.now()};
  }
  if (fenced) {
    fenced->Close(absl::AbortedError(
        absl::StrCat("the stream of ", fenced_name, " is closed: ", name, " took over")));
  }
  return registration;
}

bool AgentDirectory::Unregister(Registration registration) {
  std::shared_ptr<AgentLink> link;  // released after the lock
  std::lock_guard lock(mutex_);
  for (auto& [agent_id, entry] : by_agent_id_) {
    if (entry.registration != registration || !entry.link) continue;
    link = std::move(entry.link);
    entry.agent.connected = false;
    entry.agent.disconnect_utc_ns = UtcNowNs(options_.utc_now_ns);
    --connected_count_;
    ForgetOldest();
    return true;
  }
  return false;
}

void AgentDirectory::ForgetOldest() {
  while (by_agent_id_.size() - connected_count_ > options_.max_remembered_agents) {
    // Connected ones come last.
    by_agent_id_.erase(std::min_element(
        by_agent_id_.begin(), by_agent_id_.end(), [](const auto& a, const auto& b) {
          return std::tuple(a.second.link != nullptr, a.second.registration) <
                 std::tuple(b.second.link != nullptr, b.second.registration);
        }));
  }
}

std::vector<AgentDirectory::ConnectedCamera> AgentDirectory::ConnectedCameras(
    std::string_view rig) const {
  std::vector<ConnectedCamera> cameras;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [agent_id, entry] : by_agent_id_) {
      if (!entry.link || (!rig.empty() && entry.agent.rig != rig)) continue;
      for (const AnnouncedCamera& camera : entry.agent.cameras) {
        cameras.push_back({camera, agent_id, entry.link, entry.registration, entry.agent.rig});
      }
    }
  }
  std::sort(cameras.begin(), cameras.end(), [](const auto& a, const auto& b) {
    return std::tie(a.camera.description.camera, a.rig) <
           std::tie(b.camera.description.camera, b.rig);
  });
  return cameras;
}

std::vector<std::string> AgentDirectory::ConnectedCameraNames(std::string_view rig) const {
  std::vector<std::string> names;
  for (const ConnectedCamera& camera : ConnectedCameras(rig)) {
    names.push_back(camera.camera.description.camera);
  }
  return names;
}

std::optional<AgentDirectory::ConnectedAgent> AgentDirectory::FindAgent(
    std::string_view agent_id) const {
  std::lock_guard lock(mutex_);
  const auto found = by_agent_id_.find(agent_id);
  if (found == by_agent_id_.end() || !found->second.link) return std::nullopt;
  const Entry& entry = found->second;
  return ConnectedAgent{found->first, entry.agent.rig, entry.link, entry.registration};
}

std::vector<AgentRecord> AgentDirectory::List(std::string_view rig) const {
  std::vector<AgentRecord> agents;
  std::lock_guard lock(mutex_);
  for (const auto& [agent_id, entry] : by_agent_id_) {
    if (rig.empty() || entry.agent.rig == rig) agents.push_back(entry.agent);
  }
  return agents;
}

size_t AgentDirectory::ConnectedCount() const {
  std::lock_guard lock(mutex_);
  return connected_count_;
}

void AgentDirectory::SetSpool(Registration registration, SpoolStatus status) {
  std::lock_guard lock(mutex_);
  for (auto& [agent_id, entry] : by_agent_id_) {
    if (entry.registration != registration || !entry.link) continue;
    entry.agent.spool = std::move(status);
    entry.heard = options_.now();
    return;
  }
}

void AgentDirectory::SetStreamReport(const StreamKey& stream, SpoolReport report) {
  std::lock_guard lock(mutex_);
  const bool is_full = stream_reports_.size() >= options_.max_stream_reports;
  if (is_full && !stream_reports_.contains(stream)) return;
  stream_reports_.insert_or_assign(stream, std::move(report));
}

std::optional<SpoolReport> AgentDirectory::StreamReport(const StreamKey& stream) const {
  std::lock_guard lock(mutex_);
  const auto found = stream_reports_.find(stream);
  if (found == stream_reports_.end()) return std::nullopt;
  return found->second;
}

void AgentDirectory::ForgetStreamReport(const StreamKey& stream) {
  std::lock_guard lock(mutex_);
  stream_reports_.erase(stream);
}

StreamHolder AgentDirectory::HolderOf(std::string_view agent_id, const StreamKey& stream) const {
  if (agent_id.empty()) return StreamHolder::kNone;
  std::lock_guard lock(mutex_);
  const auto found = by_agent_id_.find(agent_id);
  if (found == by_agent_id_.end() || !found->second.link) return StreamHolder::kAway;
  const AgentRecord& agent = found->second.agent;
  const AnnouncedCamera* const camera = FindCamera(agent, stream.camera);
  const bool has = (camera != nullptr && camera->stream_epoch == stream.stream_epoch) ||
                   std::ranges::find(agent.pending, stream) != agent.pending.end();
  return has ? StreamHolder::kConnected : StreamHolder::kGone;
}

void AgentDirectory::CloseAll(const absl::Status& reason) {
  std::vector<std::shared_ptr<AgentLink>> links;
  {
    std::lock_guard lock(mutex_);
    closed_ = true;
    for (const auto& [agent_id, entry] : by_agent_id_) {
      if (entry.link) links.push_back(entry.link);
    }
  }
  for (const auto& link : links) link->Close(reason);
}

}  // namespace rigcal::server
