// SPDX-License-Identifier: Apache-2.0
#include "client/commands/monitor_command.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/commands/calibrate_command.h"
#include "client/commands/rig_command.h"
#include "client/output/quantities.h"
#include "client/tables/rig_table.h"
#include "rigcal/v1/calibration_service.grpc.pb.h"
#include "rigcal/v1/live_service.grpc.pb.h"
#include "rigcal/v1/rig_service.grpc.pb.h"

namespace rigcal::client {
namespace {

using CalibrationStub = v1::CalibrationService::Stub;

// Smaller steps of a clock move no marker by a pixel.
constexpr double kClockSigmas = 6, kClockStepS = 2e-4;

// What-if, with the lenses as the active calibration has them.
v1::CreateCalibrationRequest LookRequest(const std::string& session,
                                         const v1::Calibration& active) {
  v1::CreateCalibrationRequest request;
  request.add_session_ids(session);
  request.set_reason(absl::StrCat("monitor of calibration ", active.id()));
  v1::CalibrationOptions& options = *request.mutable_options();
  options.set_parent_id(active.id());
  options.set_what_if(true);
  options.set_intrinsics(v1::CalibrationOptions::ESTIMATE_FIXED);
  for (const v1::CalibratedCamera& camera : active.cameras()) {
    v1::CameraIntrinsics* const given = options.add_given_intrinsics();
    given->set_camera(camera.camera());
    *given->mutable_image_size_px() = camera.image_size_px();
    *given->mutable_intrinsics() = camera.intrinsics();
  }
  return request;
}

v1::CreateCalibrationRequest RepairRequest(const std::string& session, const std::string& parent,
                                           const std::vector<std::string>& cameras) {
  v1::CreateCalibrationRequest request;
  request.add_session_ids(session);
  request.set_reason(absl::StrCat("monitor: ", absl::StrJoin(cameras, ", "), " moved"));
  request.mutable_options()->set_parent_id(parent);
  request.mutable_options()->set_kind(v1::CalibrationOptions::KIND_REPAIR);
  request.mutable_options()->mutable_only_cameras()->Assign(cameras.begin(), cameras.end());
  return request;
}

std::vector<std::string> MovedCameras(const v1::CompareCalibrationsResponse& difference) {
  std::vector<std::string> moved;
  for (const v1::CameraDifference& camera : difference.cameras()) {
    if (camera.verdict() == v1::CameraDifference::VERDICT_MOVED) moved.push_back(camera.camera());
  }
  return moved;
}

// The sentences below the table.
std::string Conclusion(const MonitorOptions& options,
                       const v1::CompareCalibrationsResponse& difference) {
  std::string text;
  const std::vector<std::string> moved = MovedCameras(difference);
  if (!difference.problem().empty()) {
    absl::StrAppend(&text, difference.problem(), "\n");
  } else if (moved.empty()) {
    absl::StrAppend(&text, "no camera has moved\n");
  } else {
    absl::StrAppend(&text, absl::StrJoin(moved, ", "), moved.size() == 1 ? " has" : " have",
                    " moved; repair: rigcal calibrate ", options.session, " --only ",
                    absl::StrJoin(moved, ","), " --activate\n");
  }
  const std::string hidden = CamerasWith(difference, v1::CameraDifference::VERDICT_UNKNOWN);
  if (difference.problem().empty() && !hidden.empty()) {
    absl::StrAppend(&text, "of ", hidden,
                    " the session says too little: wave where it sees the "
                    "wand together with others\n");
  }
  if (!difference.only_in_a().empty()) {
    absl::StrAppend(&text, "no word of ", absl::StrJoin(difference.only_in_a(), ", "),
                    ": not in the session\n");
  }
  for (const std::string& step : SteppedClocks(difference)) absl::StrAppend(&text, step, "\n");
  return text;
}

// What the server's monitor says.
ExitCode ShowMonitor(const MonitorOptions& options, ServerConnection& server,
                     CommandContext& context) {
  v1::GetLiveRequest request;
  request.set_rig(options.rig);
  const auto response = server.Call(&v1::LiveService::Stub::GetLive, request);
  if (!response.ok()) return context.Fail(response.status());
  const v1::LiveMonitor& monitor = response->live().monitor();
  const ExitCode shown = context.Show(absl::StatusOr<v1::LiveMonitor>(monitor), FormatMonitor);
  if (shown != ExitCode::kOk) return shown;
  const bool moved =
      monitor.all_moved() || std::ranges::any_of(monitor.cameras(), [](const auto& camera) {
        return camera.verdict() == v1::LiveMonitoredCamera::VERDICT_MOVED;
      });
  return moved ? ExitCode::kCameraMoved : ExitCode::kOk;
}

ExitCode Repair(const MonitorOptions& options, const std::string& parent,
                const std::vector<std::string>& moved, ServerConnection& server,
                CommandContext& context) {
  const absl::StatusOr<v1::Calibration> repaired =
      CalibrateSuccessfully(server, RepairRequest(options.session, parent, moved), context);
  if (!repaired.ok()) return context.Fail(repaired.status());
  return ActivateIfGood(server, *repaired, "monitor --auto", context);
}

}  // namespace

std::vector<std::string> SteppedClocks(const v1::CompareCalibrationsResponse& difference) {
  std::vector<std::string> steps;
  for (const v1::CameraDifference& camera : difference.cameras()) {
    const double sigma_s = camera.time_offset_sigma_s(), step_s = std::abs(camera.time_offset_s());
    if (!(sigma_s > 0) || step_s < kClockStepS || step_s < kClockSigmas * sigma_s) continue;
    steps.push_back(absl::StrCat(
        "the clock of ", camera.camera(), " is ", FormatFixed(1e3 * camera.time_offset_s(), 3),
        " ms (+- ", FormatFixed(1e3 * sigma_s, 3),
        ") from where it was against the others: it has stepped or drifted, or the cameras were "
        "started anew; offsets are searched in each calibration, poses are not touched by it"));
  }
  return steps;
}

ExitCode Monitor(const MonitorOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  if (options.session.empty()) return ShowMonitor(options, server, context);
  absl::StatusOr<std::string> against = options.against;
  if (options.against.empty()) against = ActiveCalibrationOf(server, options.rig);
  if (!against.ok()) return context.Fail(against.status());
  const auto active = CalibrationOf(server.CallWithId(&CalibrationStub::GetCalibration, *against));
  if (!active.ok()) return context.Fail(active.status());
  const absl::StatusOr<v1::Calibration> now =
      CalibrateSuccessfully(server, LookRequest(options.session, *active), context);
  if (!now.ok()) return context.Fail(now.status());
  const auto difference = FetchDifference(server, active->id(), now->id());
  if (!difference.ok()) return context.Fail(difference.status());
  context.Show(difference, [&](const v1::CompareCalibrationsResponse& shown) {
    return FormatDifference(shown) + Conclusion(options, shown);
  });
  const std::vector<std::string> moved = MovedCameras(*difference);
  if (!difference->problem().empty()) return ExitCode::kCameraMoved;
  if (moved.empty()) return ExitCode::kOk;
  return options.repair ? Repair(options, active->id(), moved, server, context)
                        : ExitCode::kCameraMoved;
}

ExitCode SetMonitorMode(const MonitorModeOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  if (options.mode.empty()) return ShowMonitor({.rig = options.rig}, server, context);
  v1::SetRigMonitorRequest request;
  request.set_name(options.rig);
  request.set_mode(options.mode == "off"     ? v1::MONITOR_MODE_OFF
                   : options.mode == "watch" ? v1::MONITOR_MODE_WATCH
                                             : v1::MONITOR_MODE_REPAIR);
  const auto response = server.Call(&v1::RigService::Stub::SetRigMonitor, request);
  if (!response.ok()) return context.Fail(response.status());
  return context.Show(absl::StatusOr<v1::Rig>(response->rig()), FormatRig);
}

}  // namespace rigcal::client
