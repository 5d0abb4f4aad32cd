// SPDX-License-Identifier: Apache-2.0
#include "client/commands/calibrate_command.h"

#include <chrono>
#include <functional>

#include "absl/strings/str_cat.h"
#include "client/net/polling.h"
#include "client/net/server_connection.h"
#include "client/results/ground_truth_comparison.h"
#include "client/tables/calibration_table.h"
#include "common/wire/calibration_wire.h"

namespace rigcal::client {

using CalibrationStub = v1::CalibrationService::Stub;

namespace {

// A watching stream is opened anew this often, so that a server that went away without a word is
// noticed.
constexpr std::chrono::milliseconds kWatchTimeout{60'000};

// Follows the calibration by a stream; where that breaks (a restart of the server, too many
// watchers), by asking from time to time.
absl::StatusOr<v1::Calibration> WaitForEnd(
    ServerConnection& server, const std::string& id,
    const std::function<void(const v1::Calibration&)>& show) {
  v1::WatchCalibrationRequest watch;
  watch.set_id(id);
  v1::Calibration latest;
  absl::Status stream = absl::DeadlineExceededError("");
  while (absl::IsDeadlineExceeded(stream)) {
    stream = server.Read(&CalibrationStub::WatchCalibration, watch, kWatchTimeout,
                         [&](const v1::WatchCalibrationResponse& response) {
                           latest = response.calibration();
                           show(latest);
                           return !HasEnded(latest);
                         });
    if (HasEnded(latest)) return latest;
  }
  if (absl::IsNotFound(stream)) return stream;
  return PollUntil(
      [&] { return CalibrationOf(server.CallWithId(&CalibrationStub::GetCalibration, id)); },
      [&](const v1::Calibration& now) {
        show(now);
        return HasEnded(now);
      },
      PollOptions());
}

}  // namespace

ExitCode Calibrate(const CalibrateOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  absl::StatusOr<v1::Calibration> calibration =
      CalibrationOf(server.Call(&CalibrationStub::CreateCalibration,
                                MakeCalibrationRequest(options.sessions, options.calibration)));
  if (!calibration.ok()) return context.Fail(calibration.status());
  const std::string id = calibration->id();
  if (!options.wait) {
    if (context.console.format == OutputFormat::kTable) {
      context.console.Message(absl::StrCat("rigcal calibration get ", id, " shows its progress"));
    }
    return ShowCalibration(*calibration, context);
  }
  ProgressLine progress(context.console);
  calibration = WaitForEnd(server, id, [&](const v1::Calibration& now) {
    progress.Show(FormatCalibrationProgress(now));
  });
  progress.Clear();
  if (!calibration.ok()) {
    context.console.Message(absl::StrCat("stopped waiting for calibration ", id,
                                         "; rigcal calibration get ", id, " shows it later"));
    return context.Fail(calibration.status());
  }
  return ShowCalibration(*calibration, context);
}

ExitCode ShowCalibration(const v1::Calibration& calibration, CommandContext& context,
                         const GroundTruthComparison* ground_truth) {
  if (context.console.format == OutputFormat::kJson) {
    context.console.out << CalibrationJson(calibration, ground_truth) << "\n" << std::flush;
  } else {
    context.console.out << FormatCalibration(calibration)
                        << (ground_truth ? FormatGroundTruthErrors(*ground_truth) : "")
                        << std::flush;
  }
  if (calibration.state() == v1::Calibration::STATE_FAILED) {
    context.console.Message(
        absl::StrCat("calibration ", calibration.id(), " failed: ", calibration.error()));
    return ExitCode::kFailed;
  }
  const bool bad = calibration.state() == v1::Calibration::STATE_SUCCEEDED &&
                   calibration.quality().grade() == v1::Quality::GRADE_BAD;
  return bad ? ExitCode::kBelowQualityGate : ExitCode::kOk;
}

bool HasEnded(const v1::Calibration& calibration) {
  return calibration.state() == v1::Calibration::STATE_SUCCEEDED ||
         calibration.state() == v1::Calibration::STATE_FAILED;
}

v1::CreateCalibrationRequest MakeCalibrationRequest(const std::vector<std::string>& sessions,
                                                    const CalibrationOptions& options) {
  v1::CreateCalibrationRequest request;
  for (const std::string& session : sessions) request.add_session_ids(session);
  *request.mutable_options() = wire::ToProto(options);
  return request;
}

}  // namespace rigcal::client
