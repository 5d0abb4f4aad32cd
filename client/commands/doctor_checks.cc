// SPDX-License-Identifier: Apache-2.0
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
// A session that drains is finished at its deadline; so much longer, and it is stuck.
constexpr double kDrainSlackS = 10;

// Cameras that have not delivered everything and whose agent is away.
std::vector<std::string> AbsentCameras(const v1::Session& session) {
  std::vector<std::string> absent;
  for (const v1::SessionCamera& camera : session.cameras()) {
    if (!camera.ended() && !camera.connected()) absent.push_back(camera.description().camera());
  }
  return absent;
}

}  // namespace

Check CheckVersions(const v1::GetStatusResponse& status) {
  const std::string own(wire::kSoftwareVersion);
  Check check{CheckLevel::kOk, "versions",
              absl::StrCat("server ", status.software_version(), ", rigcal ", own), ""};
  if (const absl::Status protocol =
          wire::CheckProtocolVersion("the server", status.protocol_version());
      !protocol.ok()) {
    check.level = CheckLevel::kFail;
    check.message = std::string(protocol.message());
    check.advice = "install the same version of rigcal on both sides";
  } else if (status.software_version() != own) {
    check.level = CheckLevel::kWarn;
    check.advice = "they work together; install the same version when you can";
  }
  return check;
}

Check CheckHealthWord(const std::string& word) {
  if (word == "SERVING") return {CheckLevel::kOk, "health", "serving", ""};
  return {CheckLevel::kFail, "health", absl::StrCat("the server says ", word),
          "look at the ingest and disk lines here and at the server's log"};
}

Check CheckIngest(const v1::IngestStatus& ingest) {
  Check check{CheckLevel::kOk, "ingest",
              absl::StrCat(ingest.stored_observation_count(), " observations stored, ",
                           ingest.refused_observation_count(), " refused since the start"),
              ""};
  if (!ingest.problem().empty()) {
    check.level = CheckLevel::kFail;
    check.message = absl::StrCat("nothing is taken: ", ingest.problem());
    check.advice = "agents keep their data meanwhile; fix the cause, and delivery resumes";
  } else if (ingest.queue_limit_bytes() > 0 &&
             static_cast<double>(ingest.queue_bytes()) >
                 kFullQueue * static_cast<double>(ingest.queue_limit_bytes())) {
    check.level = CheckLevel::kWarn;
    check.message = absl::StrCat("the queue is nearly full: ", FormatBytes(ingest.queue_bytes()),
                                 " of ", FormatBytes(ingest.queue_limit_bytes()));
    check.advice = "the disk is slower than the cameras; agents wait and lose nothing";
  } else if (ingest.refused_observation_count() > 0) {
    check.level = CheckLevel::kWarn;
    check.advice = "rigcal session get SESSION lists what was refused, and why";
  }
  return check;
}

Check CheckDisk(const v1::StoreStatus& store) {
  Check check{CheckLevel::kOk, "disk",
              absl::StrCat(FormatBytes(store.free_bytes()), " free; the store (", store.kind(),
                           ") takes ", FormatBytes(store.size_bytes())),
              ""};
  if (store.free_bytes() >= kWarnFreeBytes) return check;
  check.level = store.free_bytes() < kFailFreeBytes ? CheckLevel::kFail : CheckLevel::kWarn;
  check.advice = "make room on the server's disk, or delete old sessions: rigcal session delete";
  return check;
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
  Check check{CheckLevel::kOk, "agents",
              absl::StrCat(FormatCount(connected, "agent", "agents"), " with ",
                           FormatCount(cameras, "camera", "cameras"), " connected"),
              ""};
  if (!gone.empty()) {
    check.level = CheckLevel::kWarn;
    absl::StrAppend(&check.message, "; gone: ", absl::StrJoin(gone, ", "));
    check.advice = "if they are still needed, see whether rigcal-agent runs on their hosts";
  } else if (connected == 0) {
    check.level = CheckLevel::kWarn;
    check.advice = "start rigcal-agent --server HOST:PORT on the PC of each camera";
  }
  return check;
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
            connected == 0 ? "no camera is connected" : "every connected camera has intrinsics",
            ""};
  }
  return {CheckLevel::kWarn, "intrinsics",
          absl::StrCat("without intrinsics: ", absl::StrJoin(without, ", ")),
          "such a camera can stream but not be calibrated; give its agent a calibration file"};
}

Check CheckSessions(const v1::ListSessionsResponse& sessions, double now_s) {
  size_t open = 0;
  std::vector<std::string> stuck;
  for (const v1::Session& session : sessions.sessions()) {
    const bool drains = session.state() == v1::Session::STATE_DRAINING;
    if (!drains && session.state() != v1::Session::STATE_CAPTURING) continue;
    ++open;
    if (drains && session.has_drain_deadline() &&
        now_s > static_cast<double>(session.drain_deadline().seconds()) + kDrainSlackS) {
      stuck.push_back(absl::StrCat(session.id(), " (draining past its deadline)"));
    } else if (const auto absent = AbsentCameras(session); !absent.empty()) {
      stuck.push_back(absl::StrCat(session.id(), " (waits for ", absl::StrJoin(absent, ", "), ")"));
    }
  }
  Check check{CheckLevel::kOk, "sessions",
              absl::StrCat(sessions.sessions_size(), " in all, ", open, " capturing or draining"),
              ""};
  if (!stuck.empty()) {
    check.level = CheckLevel::kWarn;
    check.message = absl::StrCat("stuck: ", absl::StrJoin(stuck, "; "));
    check.advice =
        "bring the agents of these cameras back, or end it without them: rigcal session stop";
  }
  return check;
}

}  // namespace rigcal::client
