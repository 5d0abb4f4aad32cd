// SPDX-License-Identifier: Apache-2.0
#include "client/commands/calibrate_command.h"

#include "absl/strings/str_cat.h"
#include "client/net/polling.h"
#include "client/net/server_connection.h"
#include "client/output/output.h"
#include "client/tables/calibration_table.h"
#include "common/wire/calibration_wire.h"

namespace rigcal::client {

using CalibrationStub = v1::CalibrationService::Stub;

ExitCode Calibrate(const CalibrateOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  absl::StatusOr<v1::Calibration> calibration =
      server.Call(server.calibrations(), &CalibrationStub::CreateCalibration,
                  MakeCalibrationRequest(options.sessions, options.calibration));
  if (!calibration.ok()) return context.Fail(calibration.status());
  if (!options.wait) {
    if (context.console.format == OutputFormat::kTable) {
      context.console.Message(
          absl::StrCat("rigcal calibration get ", calibration->id(), " shows how far it is"));
    }
    return ShowCalibration(*calibration, context);
  }

  v1::GetCalibrationRequest request;
  request.set_id(calibration->id());
  ProgressLine progress(context.console);
  calibration = PollUntil<v1::Calibration>(
      [&] { return server.Call(server.calibrations(), &CalibrationStub::GetCalibration, request); },
      [&](const v1::Calibration& now) {
        progress.Show(FormatCalibrationProgress(now));
        return HasEnded(now);
      },
      {});
  progress.Clear();
  if (!calibration.ok()) {
    context.console.Message(absl::StrCat("stopped waiting for calibration ", request.id(),
                                         "; rigcal calibration get ", request.id(),
                                         " shows it later"));
    return context.Fail(calibration.status());
  }
  return ShowCalibration(*calibration, context);
}

ExitCode ShowCalibration(const v1::Calibration& calibration, CommandContext& context) {
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(context.console, calibration);
  } else {
    context.console.out << FormatCalibration(calibration) << std::flush;
  }
  if (calibration.state() == v1::Calibration::FAILED) {
    context.console.Message(
        absl::StrCat("calibration ", calibration.id(), " failed: ", calibration.error()));
    return ExitCode::kFailed;
  }
  const bool bad = calibration.state() == v1::Calibration::SUCCEEDED &&
                   calibration.quality().grade() == v1::Quality::BAD;
  return bad ? ExitCode::kBelowQualityGate : ExitCode::kOk;
}

bool HasEnded(const v1::Calibration& calibration) {
  return calibration.state() == v1::Calibration::SUCCEEDED ||
         calibration.state() == v1::Calibration::FAILED;
}

v1::CreateCalibrationRequest MakeCalibrationRequest(const std::vector<std::string>& sessions,
                                                    const CalibrationOptions& options) {
  v1::CreateCalibrationRequest request;
  for (const std::string& session : sessions) request.add_session_ids(session);
  *request.mutable_options() = wire::ToProto(options);
  return request;
}

}  // namespace rigcal::client
