// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/commands/doctor_command.h"
#include "client/output/quantities.h"
#include "common/wire/protocol_version.h"

namespace rigcal::client {
namespace {

constexpr uint64_t kWarnFreeBytes = uint64_t{2} << 30;
constexpr uint64_t kFailFreeBytes = uint64_t{200} << 20;
constexpr double kFullQueue = 0.9;
// A standby copies some times a second.
constexpr double kStandbyLagS = 5;
// A session that drains is finished at its deadline; so much longer, and it is stuck.
constexpr double kDrainSlackS = 10;

}  // namespace

Check CheckVersions(const v1::GetStatusResponse& status) {
  const std::string own(wire::kSoftwareVersion);
  if (const absl::Status protocol =
          wire::CheckProtocolVersion("the server", status.protocol_version());
      !protocol.ok()) {
    return {CheckLevel::kFail, "versions", std::string(protocol.message()),
            "install the same version of rigcal on both sides"};
  }
  const std::string both = absl::StrCat("server ", status.software_version(), ", rigcal ", own);
  if (status.software_version() == own) return {CheckLevel::kOk, "versions", both};
  return {CheckLevel::kWarn, "versions", both,
          "they work together; install the same version when you can"};
}

Check CheckHealthWord(const std::string& word) {
  if (word == "SERVING") return {CheckLevel::kOk, "health", "serving"};
  return {CheckLevel::kFail, "health", absl::StrCat("the server says ", word),
          "look at the ingest and disk lines here and at the server's log"};
}

Check CheckIngest(const v1::IngestStatus& ingest) {
  if (!ingest.problem().empty()) {
    return {CheckLevel::kFail, "ingest", absl::StrCat("nothing is taken: ", ingest.problem()),
            "agents keep their data meanwhile; fix the cause, and delivery resumes"};
  }
  if (ingest.queue_limit_bytes() > 0 &&
      static_cast<double>(ingest.queue_bytes()) >
          kFullQueue * static_cast<double>(ingest.queue_limit_bytes())) {
    return {CheckLevel::kWarn, "ingest",
            absl::StrCat("the queue is nearly full: ", FormatBytes(ingest.queue_bytes()), " of ",
                         FormatBytes(ingest.queue_limit_bytes())),
            "the disk is slower than the cameras; agents wait and lose nothing"};
  }
  const std::string counts =
      absl::StrCat(FormatCount(ingest.stored_observation_count(), "observation"), " stored, ",
                   ingest.refused_observation_count(), " refused since the start");
  if (ingest.refused_observation_count() == 0) return {CheckLevel::kOk, "ingest", counts};
  return {CheckLevel::kWarn, "ingest", counts,
          "rigcal session get SESSION lists what was refused, and why"};
}

Check CheckStandby(const v1::StandbyStatus& standby) {
  if (!standby.connected()) {
    return {CheckLevel::kFail, "standby",
            absl::StrCat(standby.address(), " has not asked since ",
                         FormatTime(standby.has_last_time(), standby.last_time()), "; ",
                         FormatCount(standby.behind_count(), "observation"), " behind"),
            "look at its log: rigcal-server --follow says there why it does not copy"};
  }
  if (standby.behind_s() < kStandbyLagS) {
    return {
        CheckLevel::kOk, "standby",
        absl::StrCat(standby.address(),
                     standby.behind_count() == 0
                         ? std::string(" has everything")
                         : absl::StrCat(" is ", FormatCount(standby.behind_count(), "observation"),
                                        " behind"))};
  }
  return {
      CheckLevel::kWarn, "standby",
      absl::StrCat(standby.address(), " is ", FormatCount(standby.behind_count(), "observation"),
                   " and ", FormatDuration(standby.behind_s()), " behind"),
      "it copies more slowly than is stored, or its disk is full: its log says which"};
}

Check CheckConnections(const v1::ConnectionStatus& connections) {
  const std::string open =
      absl::StrCat(connections.open_count(), " open, at most ", connections.limit());
  if (connections.flooding_count() > 0 && connections.floods_size() > 0) {
    const v1::FloodRecord& last = connections.floods(0);
    const std::string peer = last.peer().empty() ? absl::StrCat("a client at ", last.address())
                             : last.address().empty()
                                 ? last.peer()
                                 : absl::StrCat(last.peer(), " at ", last.address());
    return {CheckLevel::kWarn, "connections",
            absl::StrCat(open, "; ", connections.flooding_count(),
                         " cut since the start because they flooded the server, the last one of ",
                         peer, ": ", last.reason()),
            "if this is no program of yours, take its access away: rigcal agent forget NAME, or "
            "rigcal token revoke ID"};
  }
  if (connections.deaf()) {
    return {CheckLevel::kFail, "connections", "the server's port accepts no connections",
            "restart rigcal-server"};
  }
  return {CheckLevel::kOk, "connections", open};
}

Check CheckStore(const v1::StoreStatus& store) {
  if (store.kind() == "postgresql") {
    // Where it is, and how much room it has, only its own PC knows.
    if (store.problem().empty()) {
      return {CheckLevel::kOk, "database",
              absl::StrCat("PostgreSQL answers; the database takes ",
                           FormatBytes(store.size_bytes()))};
    }
    return {CheckLevel::kFail, "database", store.problem(),
            "look at PostgreSQL, its disk, and the network to it: agents keep what they capture, "
            "and rigcal-server goes on by itself"};
  }
  if (!store.problem().empty()) {
    return {CheckLevel::kFail, "disk", store.problem(),
            "check the disk and the data (rigcal-server check), then restart rigcal-server"};
  }
  const std::string sizes = absl::StrCat(FormatBytes(store.free_bytes()), " free; the store (",
                                         store.kind(), ") takes ", FormatBytes(store.size_bytes()));
  // Unused space of the store is filled before its files grow.
  const uint64_t room = store.free_bytes() + store.unused_bytes();
  if (store.free_bytes() >= kWarnFreeBytes) return {CheckLevel::kOk, "disk", sizes};
  const bool fails = room < std::max(kFailFreeBytes, store.reserve_bytes());
  return {fails ? CheckLevel::kFail : CheckLevel::kWarn, "disk", sizes,
          "make room on the server's disk, or delete old sessions: rigcal session delete"};
}

Check CheckAgents(const v1::ListAgentsResponse& agents) {
  size_t connected = 0;
  size_t cameras = 0;
  std::vector<std::string> gone;
  for (const v1::Agent& agent : agents.agents()) {
    if (agent.connected()) {
      ++connected;
      cameras += static_cast<size_t>(agent.cameras_size());
    } else {
      gone.push_back(agent.agent_id());
    }
  }
  const std::string counts = absl::StrCat(FormatCount(connected, "agent"), " with ",
                                          FormatCount(cameras, "camera"), " connected");
  if (!gone.empty()) {
    return {CheckLevel::kWarn, "agents",
            absl::StrCat(counts, "; gone: ", absl::StrJoin(gone, ", ")),
            "if they are still needed, see whether rigcal-agent runs on their hosts"};
  }
  if (connected > 0) return {CheckLevel::kOk, "agents", counts};
  return {CheckLevel::kWarn, "agents", counts,
          "start rigcal-agent --server HOST:PORT on the PC of each camera"};
}

std::optional<Check> CheckOfferedCameras(const v1::ListAgentsResponse& agents) {
  size_t found = 0;
  size_t free = 0;
  std::vector<std::string> away;  // chosen ones
  std::vector<std::string> notes;
  for (const v1::Agent& agent : agents.agents()) {
    if (!agent.connected()) continue;
    for (const v1::OfferedCamera& camera : agent.offered()) {
      ++found;
      const std::string device = absl::StrCat(agent.agent_id(), "/", camera.device());
      const bool is_chosen = !camera.camera().empty();
      if (camera.use() == v1::OfferedCamera::USE_FREE && !is_chosen) ++free;
      if (camera.use() != v1::OfferedCamera::USE_TAKES_PART && is_chosen) {
        away.push_back(absl::StrCat(device, " (", camera.camera(), ")"));
      }
      // One that another program uses may be none of ours.
      const bool matters = is_chosen || camera.use() == v1::OfferedCamera::USE_NO_PERMISSION;
      if (matters && !camera.note().empty())
        notes.push_back(absl::StrCat(device, ": ", camera.note()));
    }
  }
  if (found == 0) return std::nullopt;
  const std::string counts = absl::StrCat(FormatCount(found, "camera"), " found, ", free,
                                          " of them not used; rigcal cameras lists them");
  if (away.empty() && notes.empty()) return Check{CheckLevel::kOk, "cameras", counts};
  return Check{
      CheckLevel::kWarn, "cameras",
      away.empty() ? counts : absl::StrCat("chosen, and take no part: ", absl::StrJoin(away, ", ")),
      absl::StrJoin(notes, "; ")};
}

Check CheckIntrinsics(const v1::ListAgentsResponse& agents) {
  size_t connected = 0;
  std::vector<std::string> without;
  for (const v1::Agent& agent : agents.agents()) {
    if (!agent.connected()) continue;
    for (const v1::CameraDescription& camera : agent.cameras()) {
      ++connected;
      if (!camera.has_intrinsics()) without.push_back(agent.rig() + "/" + camera.camera());
    }
  }
  if (without.empty()) {
    return {CheckLevel::kOk, "intrinsics",
            connected == 0 ? "no camera is connected" : "every connected camera has intrinsics"};
  }
  return {
      CheckLevel::kWarn, "intrinsics",
      absl::StrCat("without intrinsics: ", absl::StrJoin(without, ", ")),
      "such a camera can stream but not be calibrated; give its agent a calibration file, which "
      "page Lens of the dashboard makes from a printed board"};
}

Check CheckSessions(const v1::ListSessionsResponse& sessions, double now_s) {
  size_t open = 0;
  std::vector<std::string> stuck;
  std::vector<std::string> damaged;
  for (const v1::Session& session : sessions.sessions()) {
    if (!session.damage().empty()) damaged.push_back(session.damage());
    const bool drains = session.state() == v1::Session::STATE_DRAINING;
    if (!drains && session.state() != v1::Session::STATE_CAPTURING) continue;
    ++open;
    // Cameras that have not delivered everything and whose agent is away.
    std::vector<std::string> absent;
    for (const v1::SessionCamera& camera : session.cameras()) {
      if (!camera.ended() && !camera.connected()) absent.push_back(camera.description().camera());
    }
    if (drains && session.has_drain_deadline() &&
        now_s > static_cast<double>(session.drain_deadline().seconds()) + kDrainSlackS) {
      stuck.push_back(absl::StrCat(session.id(), " (draining past its deadline)"));
    } else if (!absent.empty()) {
      stuck.push_back(absl::StrCat(session.id(), " (waits for ", absl::StrJoin(absent, ", "), ")"));
    }
  }
  if (!damaged.empty()) {
    return {CheckLevel::kFail, "sessions", absl::StrJoin(damaged, "; "),
            "rigcal-server check names all that is damaged"};
  }
  if (stuck.empty()) {
    return {CheckLevel::kOk, "sessions",
            absl::StrCat(sessions.sessions_size(), " in all, ", open, " capturing or draining")};
  }
  return {CheckLevel::kWarn, "sessions", absl::StrCat("stuck: ", absl::StrJoin(stuck, "; ")),
          "bring the agents of these cameras back, or end it without them: rigcal session stop"};
}

}  // namespace rigcal::client
