// SPDX-License-Identifier: Apache-2.0
#include "client/local/local_calibration.h"

#include <chrono>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/commands/calibrate_command.h"
#include "client/commands/fetch_calibration.h"
#include "client/local/capture_table.h"
#include "client/net/paging.h"
#include "client/net/polling.h"
#include "client/tables/calibration_table.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"

namespace rigcal::client {
namespace {

using Clock = std::chrono::steady_clock;
using Sessions = v1::SessionService::Stub;
using Calibrations = v1::CalibrationService::Stub;

constexpr std::chrono::milliseconds kPollInterval{40};
// Until a server that died is noticed.
constexpr std::chrono::milliseconds kPatience{2000};
// Generous: only against hanging.
constexpr std::chrono::seconds kConnectLimit{60};
constexpr std::chrono::seconds kStallLimit{120};
constexpr std::chrono::seconds kPacedStallLimit{1800};

class LocalCalibration {
 public:
  LocalCalibration(const LocalOptions& options, const std::vector<LocalCamera>& cameras,
                   LocalRig& rig, const StopSignals& signals, Console& console)
      : options_(options),
        cameras_(cameras),
        rig_(rig),
        signals_(signals),
        console_(console),
        progress_(console) {}

  absl::StatusOr<LocalOutcome> Run() {
    LocalOutcome outcome;
    progress_.Show("starting a server");
    RIGCAL_RETURN_IF_ERROR(
        rig_.StartServer([this](std::chrono::milliseconds time) { return Wait(time); }));
    ServerConnection server(rig_.address());
    // Before the agents start, so that a bad target is refused at once.
    RIGCAL_ASSIGN_OR_RETURN(const std::string session, CreateSession(server));
    RIGCAL_RETURN_IF_ERROR(rig_.StartAgents(cameras_));
    RIGCAL_RETURN_IF_ERROR(WaitForCameras(server));
    const Clock::time_point begin = Clock::now();
    RIGCAL_ASSIGN_OR_RETURN(outcome.session, Capture(server, session));
    outcome.capture_s = std::chrono::duration<double>(Clock::now() - begin).count();
    RIGCAL_ASSIGN_OR_RETURN(outcome.calibration, Solve(server, session));
    outcome.camera_covariance = FetchCovariance(server, outcome.calibration.id());
    return outcome;
  }

 private:
  // Between two polls; notices signals and dead processes.
  absl::Status Wait(std::chrono::milliseconds time) {
    signals_.Sleep(time);
    if (StopSignals::Received() != 0) return absl::CancelledError("interrupted");
    return rig_.CheckRunning();
  }

  PollOptions Polling() {
    return {.interval = kPollInterval,
            .patience = kPatience,
            .wait = [this](std::chrono::milliseconds time) { return Wait(time); }};
  }

  absl::StatusOr<std::string> CreateSession(ServerConnection& server) {
    v1::CreateSessionRequest request;
    request.set_title("rigcal local");
    *request.mutable_target() = wire::ToProto(options_.target);
    for (const LocalCamera& camera : cameras_) request.add_camera_names(camera.name);
    RIGCAL_ASSIGN_OR_RETURN(const v1::CreateSessionResponse response,
                            server.Call(&Sessions::CreateSession, request));
    return response.session().id();
  }

  absl::Status WaitForCameras(ServerConnection& server) {
    const Clock::time_point deadline = Clock::now() + kConnectLimit;
    std::set<std::string> missing;
    const auto agents =
        PollUntil([&] { return ReadAllPages(server, &v1::AgentService::Stub::ListAgents); },
                  [&](const v1::ListAgentsResponse& response) {
                    missing.clear();
                    for (const LocalCamera& camera : cameras_) missing.insert(camera.name);
                    for (const v1::Agent& agent : response.agents()) {
                      if (!agent.connected()) continue;
                      for (const auto& camera : agent.cameras()) missing.erase(camera.camera());
                    }
                    progress_.Show(absl::StrCat("connecting: ", cameras_.size() - missing.size(),
                                                " of ", cameras_.size(), " cameras"));
                    return missing.empty() || Clock::now() > deadline;
                  },
                  Polling());
    if (!agents.ok()) return agents.status();
    if (missing.empty()) return absl::OkStatus();
    return absl::DeadlineExceededError(
        absl::StrCat("after ", kConnectLimit.count(), " s no agent has connected for ",
                     absl::StrJoin(missing, ", "), "; the last lines of the log of ",
                     *missing.begin(), ":\n", rig_.AgentLogTail(*missing.begin())));
  }

  absl::StatusOr<v1::Session> Capture(ServerConnection& server, const std::string& id) {
    RIGCAL_RETURN_IF_ERROR(server.CallWithId(&Sessions::StartSession, id).status());
    // Sources that play at recorded speed may pause.
    const std::chrono::seconds limit = options_.speed == "max" ? kStallLimit : kPacedStallLimit;
    Clock::time_point last_change = Clock::now();
    uint64_t last_seen = 0;
    auto session = PollUntil(
        [&] { return SessionOf(server.CallWithId(&Sessions::GetSession, id)); },
        [&](const v1::Session& now) {
          uint64_t seen = now.observation_count();
          for (const v1::SessionCamera& camera : now.cameras()) {
            for (const v1::RefusalCount& refusal : camera.refused()) seen += refusal.count();
          }
          if (seen != last_seen) last_change = Clock::now();
          last_seen = seen;
          progress_.Show(FormatCaptureProgress(now, cameras_));
          return now.state() == v1::Session::STATE_FINISHED || Clock::now() - last_change > limit;
        },
        Polling());
    if (session.ok()) RIGCAL_RETURN_IF_ERROR(CheckCapture(*session, limit));
    return session;
  }

  absl::Status CheckCapture(const v1::Session& session, std::chrono::seconds limit) {
    if (session.state() != v1::Session::STATE_FINISHED) {
      std::vector<std::string> waiting;
      for (const v1::SessionCamera& camera : session.cameras()) {
        if (!camera.ended()) waiting.push_back(camera.description().camera());
      }
      if (waiting.empty()) {
        return absl::DeadlineExceededError(
            "every camera has delivered everything, but the session does not finish");
      }
      return absl::DeadlineExceededError(absl::StrCat(
          "no observations arrived for ", limit.count(), " s, and ", absl::StrJoin(waiting, ", "),
          " had more to send; the last lines of the log of ", waiting[0], ":\n",
          rig_.AgentLogTail(waiting[0])));
    }
    if (!session.missing_cameras().empty()) {
      progress_.Clear();
      console_.Message(absl::StrCat("the session finished without the last observations of ",
                                    absl::StrJoin(session.missing_cameras(), ", ")));
    }
    return absl::OkStatus();
  }

  absl::StatusOr<v1::Calibration> Solve(ServerConnection& server, const std::string& session) {
    RIGCAL_ASSIGN_OR_RETURN(const v1::CreateCalibrationResponse created,
                            server.Call(&Calibrations::CreateCalibration,
                                        MakeCalibrationRequest({session}, options_.calibration)));
    return PollUntil(
        [&] {
          return CalibrationOf(
              server.CallWithId(&Calibrations::GetCalibration, created.calibration().id()));
        },
        [&](const v1::Calibration& now) {
          progress_.Show(FormatCalibrationProgress(now));
          return HasEnded(now);
        },
        Polling());
  }

  const LocalOptions& options_;
  const std::vector<LocalCamera>& cameras_;
  LocalRig& rig_;
  const StopSignals& signals_;
  Console& console_;
  ProgressLine progress_;
};

}  // namespace

absl::StatusOr<LocalOutcome> CalibrateLocally(const LocalOptions& options,
                                              const std::vector<LocalCamera>& cameras,
                                              LocalRig& rig, const StopSignals& signals,
                                              Console& console) {
  absl::StatusOr<LocalOutcome> outcome =
      LocalCalibration(options, cameras, rig, signals, console).Run();
  // When a call failed because the server died, its log explains more.
  const Clock::time_point deadline = Clock::now() + kPatience;
  while (absl::IsUnavailable(outcome.status()) && Clock::now() < deadline) {
    if (absl::Status died = rig.CheckRunning(); !died.ok()) return died;
    signals.Sleep(kPollInterval);
  }
  return outcome;
}

}  // namespace rigcal::client
