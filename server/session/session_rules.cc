// SPDX-License-Identifier: Apache-2.0
#include "server/session/session_rules.h"

#include <algorithm>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/text/printable.h"

namespace rigcal::server {
namespace {

constexpr double kDefaultDrainTimeoutS = 10;
constexpr double kMaxDrainTimeoutS = 600;
constexpr size_t kMaxTitleBytes = 200;

absl::Status TooManyCameras(size_t count, size_t max_cameras) {
  return absl::ResourceExhaustedError(
      absl::StrCat(count, " cameras are too many for one session; at most ", max_cameras,
                   " are allowed: raise limits.max_cameras_per_session on the server"));
}

std::string QuotedList(const std::vector<std::string>& names) {
  return absl::StrJoin(names, ", ", [](std::string* out, const std::string& name) {
    absl::StrAppend(out, "'", name, "'");
  });
}

void CheckGoal(const SessionGoal& goal, FaultList* faults) {
  if (!(goal.until_mm > 0 && goal.until_mm <= SessionGoal::kMaxUntilMm)) {
    faults->Add("goal.until_mm is ", goal.until_mm, "; it must be above 0 and at most ",
                SessionGoal::kMaxUntilMm, " mm");
  }
  if (!(goal.min_duration_s >= 0 && goal.min_duration_s <= SessionGoal::kMaxMinDurationS)) {
    faults->Add("goal.min_duration is ", goal.min_duration_s, " s; it must be 0 to ",
                SessionGoal::kMaxMinDurationS, " s");
  }
}

}  // namespace

absl::Status ValidateNewSession(const Session& session, size_t max_cameras) {
  FaultList faults;
  if (!session.id.empty()) faults.Add(ValidateName("session id", session.id));
  faults.Add(ValidateName("rig name", session.rig));
  if (session.title.size() > kMaxTitleBytes) {
    faults.Add("the title has ", session.title.size(), " bytes; at most ", kMaxTitleBytes,
               " are allowed");
  }
  if (const std::string shown = Printable(session.title); shown != session.title) {
    faults.Add("the title \"", std::string(Beginning(shown, kMaxTitleBytes)),
               "\" has control characters");
  }
  faults.Add(session.target.Validate());
  std::set<std::string> names;
  for (const std::string& name : session.requested_cameras) {
    faults.Add(ValidateName("camera name", name));
    if (!names.insert(name).second) faults.Add("camera '", name, "' is named twice");
  }
  for (const SessionCamera& camera : session.cameras) {
    faults.Add(camera.description.Validate());
    if (!names.insert(camera.description.camera).second) {
      faults.Add("camera '", camera.description.camera, "' is named or described twice");
    }
  }
  if (session.goal) CheckGoal(*session.goal, &faults);
  if (!session.continues.empty()) {
    faults.Add(ValidateName("id of the continued session", session.continues));
  }
  RIGCAL_RETURN_IF_ERROR(faults.Result());
  const size_t count = session.requested_cameras.size() + session.cameras.size();
  return count > max_cameras ? TooManyCameras(count, max_cameras) : absl::OkStatus();
}

absl::StatusOr<std::vector<SessionCamera>> ChooseCameras(
    const Session& session, absl::Span<const AgentDirectory::ConnectedCamera> connected,
    size_t max_cameras) {
  std::vector<SessionCamera> cameras;
  for (const SessionCamera& camera : session.cameras) {
    if (camera.agent_id.empty()) cameras.push_back(camera);
  }
  const bool take_all = session.requested_cameras.empty() && cameras.empty();
  std::set<std::string> wanted(session.requested_cameras.begin(), session.requested_cameras.end());
  std::vector<std::string> available;
  for (const AgentDirectory::ConnectedCamera& camera : connected) {
    const std::string& name = camera.camera.description.camera;
    available.push_back(name);
    if (wanted.erase(name) > 0 || take_all) {
      cameras.push_back({camera.camera.description, camera.agent_id});
    }
  }
  if (!wanted.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("session '", session.id, "' cannot start: no agent of rig '", session.rig,
                     "' is connected with camera ", QuotedList({wanted.begin(), wanted.end()}),
                     available.empty() ? std::string("; no camera of this rig is connected")
                                       : absl::StrCat("; connected are ", QuotedList(available))));
  }
  if (cameras.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("session '", session.id, "' cannot start: no camera of rig '", session.rig,
                     "' is connected; start an agent with this rig's name"));
  }
  if (cameras.size() > max_cameras) return TooManyCameras(cameras.size(), max_cameras);
  std::sort(cameras.begin(), cameras.end(), [](const auto& a, const auto& b) {
    return a.description.camera < b.description.camera;
  });
  return cameras;
}

absl::Status CheckNotCapturing(const Session& starting, absl::Span<const Session> active) {
  for (const Session& other : active) {
    if (other.rig != starting.rig || other.state != SessionState::kCapturing) continue;
    for (const SessionCamera& camera : starting.cameras) {
      if (camera.agent_id.empty() || other.FindCamera(camera.description.camera) == nullptr) {
        continue;
      }
      return absl::FailedPreconditionError(
          absl::StrCat("session '", starting.id, "' cannot start: camera '", starting.rig, "/",
                       camera.description.camera, "' takes part in session '", other.id,
                       "', which is ", StateSince(other), "; stop that first"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckContinues(const Session& session, const Session& earlier) {
  const auto fault = [&](const std::string& why) {
    return absl::FailedPreconditionError(
        absl::StrCat("the new session cannot continue session '", earlier.id, "': ", why));
  };
  if (earlier.state != SessionState::kFinished) {
    return fault(absl::StrCat("it is ", StateSince(earlier), "; wait until it has finished"));
  }
  if (earlier.rig != session.rig) {
    return fault(absl::StrCat("that was of rig '", earlier.rig, "', not of '", session.rig, "'"));
  }
  if (!(earlier.target == session.target)) {
    return fault(absl::StrCat("its target was ", FormatTarget(earlier.target), ", not ",
                              FormatTarget(session.target)));
  }
  if (earlier.observations_delete_utc_ns != 0) {
    return fault("its observations have been deleted");
  }
  RIGCAL_RETURN_IF_ERROR(CheckNotDiscarded(earlier));
  return absl::OkStatus();
}

absl::Status CheckMayStart(const Session& session) {
  if (session.state != SessionState::kCreated) {
    return absl::FailedPreconditionError(absl::StrCat(
        "session '", session.id, "' cannot start: it has been stopped already and is ",
        StateSince(session), session.stop_reason.empty() ? "" : " (", session.stop_reason,
        session.stop_reason.empty() ? "" : ")", "; create a new one"));
  }
  return CheckNotDiscarded(session);
}

absl::Status CheckMayStop(const Session& session) {
  if (session.state != SessionState::kCreated) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("session '", session.id, "' cannot be stopped: it has not been started"));
}

absl::Status CheckNotRunning(const Session& session, std::string_view action) {
  const bool capturing = session.state == SessionState::kCapturing;
  if (!capturing && session.state != SessionState::kDraining) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("session '", session.id, "' cannot be ", std::string(action), ": it is ",
                   capturing ? "capturing; stop it first" : "draining; wait for its end"));
}

absl::Status CheckNotDiscarded(const Session& session) {
  if (session.discard_utc_ns == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("session '", session.id, "' was thrown away; nothing of it was deleted: take ",
                   "it back with rigcal session discard ", session.id, " --undo"));
}

std::vector<std::string> CamerasNotEnded(const Session& session,
                                         absl::Span<const SessionCameraCounts> counts) {
  std::set<std::string> ended;
  for (const SessionCameraCounts& camera : counts) {
    if (camera.ended()) ended.insert(camera.camera);
  }
  std::vector<std::string> missing;
  for (const SessionCamera& camera : session.cameras) {
    if (!ended.contains(camera.description.camera)) missing.push_back(camera.description.camera);
  }
  return missing;
}

std::string StateSince(const Session& session) {
  const auto since = [](const char* state, int64_t utc_ns) {
    return absl::StrCat(
        state, utc_ns == 0 ? ""
                           : absl::FormatTime(" since %Y-%m-%d %H:%M:%S UTC",
                                              absl::FromUnixNanos(utc_ns), absl::UTCTimeZone()));
  };
  switch (session.state) {
    case SessionState::kCreated:
      return since("created, not started,", session.create_utc_ns);
    case SessionState::kCapturing:
      return since("capturing", session.start_utc_ns);
    case SessionState::kDraining:
      return since("draining", session.stop_utc_ns);
    case SessionState::kFinished:
      return since("finished", session.finish_utc_ns);
  }
  return "in an unknown state";
}

absl::StatusOr<double> DrainTimeout(double asked_s) {
  if (asked_s == 0) return kDefaultDrainTimeoutS;
  if (asked_s > 0 && asked_s <= kMaxDrainTimeoutS) return asked_s;
  return absl::InvalidArgumentError(absl::StrCat("drain_timeout is ", asked_s,
                                                 " s; it must be 0 (10 s) or above 0 and at most ",
                                                 kMaxDrainTimeoutS, " s"));
}

}  // namespace rigcal::server
