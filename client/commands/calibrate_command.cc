// SPDX-License-Identifier: Apache-2.0
#include "client/commands/calibrate_command.h"

#include <algorithm>
#include <chrono>
#include <functional>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "client/commands/rig_command.h"
#include "client/net/polling.h"
#include "client/net/server_connection.h"
#include "client/output/quantities.h"
#include "client/results/calibration_import.h"
#include "client/results/ground_truth_comparison.h"
#include "client/tables/calibration_table.h"
#include "client/tables/rig_table.h"
#include "common/log/correlation_id.h"
#include "common/wire/calibration_wire.h"
#include "rigcal/v1/calibration_service.grpc.pb.h"
#include "rigcal/v1/session_service.grpc.pb.h"

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

absl::StatusOr<v1::Calibration> CalibrateAndWait(ServerConnection& server,
                                                 const v1::CreateCalibrationRequest& request,
                                                 CommandContext& context) {
  absl::StatusOr<v1::Calibration> calibration =
      CalibrationOf(server.Call(&CalibrationStub::CreateCalibration, request));
  if (!calibration.ok()) return calibration.status();
  const std::string id = calibration->id();
  ProgressLine progress(context.console);
  double furthest = 0;
  std::string waiting;
  calibration = WaitForEnd(server, id, [&](const v1::Calibration& now) {
    // A server that has been restarted begins anew; what is shown only rises.
    furthest = std::max(furthest, now.progress().fraction());
    v1::Calibration shown;
    shown.set_state(now.state());
    *shown.mutable_progress() = now.progress();
    shown.mutable_progress()->set_fraction(furthest);
    if (now.progress().waiting() != waiting && !now.progress().waiting().empty()) {
      context.console.Message(
          absl::StrCat("calibration ", id, " waits: ", now.progress().waiting()));
    }
    waiting = now.progress().waiting();
    progress.Show(FormatCalibrationProgress(shown));
  });
  progress.Clear();
  if (!calibration.ok()) {
    context.console.Message(absl::StrCat("stopped waiting for calibration ", id,
                                         "; rigcal calibration get ", id, " shows it later"));
    return calibration.status();
  }
  return calibration;
}

absl::StatusOr<v1::Calibration> CalibrateSuccessfully(ServerConnection& server,
                                                      const v1::CreateCalibrationRequest& request,
                                                      CommandContext& context) {
  absl::StatusOr<v1::Calibration> calibration = CalibrateAndWait(server, request, context);
  if (!calibration.ok() || calibration->state() == v1::Calibration::STATE_SUCCEEDED) {
    return calibration;
  }
  return absl::FailedPreconditionError(
      absl::StrCat("calibration ", calibration->id(),
                   calibration->state() == v1::Calibration::STATE_CANCELLED
                       ? std::string(" was cancelled")
                       : absl::StrCat(" failed: ", calibration->error())));
}

ExitCode ActivateIfGood(ServerConnection& server, const v1::Calibration& calibration,
                        const std::string& reason, CommandContext& context) {
  const v1::Quality& quality = calibration.quality();
  if (quality.grade() != v1::Quality::GRADE_GOOD) {
    context.console.Message(absl::StrCat(
        "calibration ", calibration.id(), " is not graded good and was not made active",
        quality.reasons().empty() ? "" : absl::StrCat(": ", quality.reasons(0)),
        "; rigcal rig activate ", calibration.id(), " does so nevertheless"));
    return ExitCode::kBelowQualityGate;
  }
  const absl::StatusOr<v1::Activation> activation =
      Activate(server, calibration.id(), reason, /*force=*/false);
  if (!activation.ok()) return context.Fail(activation.status());
  // What is asked for on stdout is the calibration.
  context.console.Message(std::string(absl::StripSuffix(FormatActivation(*activation), "\n")));
  return ExitCode::kOk;
}

namespace {

// The intrinsics of a calibration of the server, or of another program's file.
absl::Status AddPrior(ServerConnection& server, const std::string& prior, CommandContext& context,
                      v1::CalibrationOptions* options) {
  v1::Calibration calibration;
  if (IsImportPath(prior)) {
    auto imported = ImportCalibration(prior);
    if (!imported.ok()) return imported.status();
    for (const std::string& message : imported->Messages()) {
      context.console.Message(absl::StrCat("--prior ", prior, ": ", message));
    }
    calibration = std::move(imported->calibration);
  } else {
    auto found = CalibrationOf(server.CallWithId(&CalibrationStub::GetCalibration, prior));
    if (!found.ok()) return found.status();
    calibration = *std::move(found);
  }
  if (calibration.cameras().empty()) {
    return absl::FailedPreconditionError(absl::StrCat("--prior ", prior, ": it has no cameras"));
  }
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    v1::CameraIntrinsics* const given = options->add_given_intrinsics();
    given->set_camera(camera.camera());
    *given->mutable_image_size_px() = camera.image_size_px();
    *given->mutable_intrinsics() = camera.intrinsics();
  }
  return absl::OkStatus();
}

// What the options mean: kinds of solve, and the calibration that they derive from.
absl::Status CompleteOptions(const CalibrateOptions& options, ServerConnection& server,
                             CommandContext& context, v1::CalibrationOptions* request) {
  if (!options.prior.empty()) {
    if (absl::Status status = AddPrior(server, options.prior, context, request); !status.ok()) {
      return status;
    }
  }
  const bool is_repair = request->only_cameras_size() > 0;
  if (is_repair) request->set_kind(v1::CalibrationOptions::KIND_REPAIR);
  if (options.refine) request->set_kind(v1::CalibrationOptions::KIND_REFINE);
  if ((!is_repair && !options.refine) || !request->parent_id().empty()) return absl::OkStatus();
  const auto session =
      SessionOf(server.CallWithId(&v1::SessionService::Stub::GetSession, options.sessions.front()));
  if (!session.ok()) return session.status();
  absl::StatusOr<std::string> active = ActiveCalibrationOf(server, session->rig());
  if (!active.ok()) return active.status();
  request->set_parent_id(*active);
  return absl::OkStatus();
}

bool IsWhatIf(const v1::CalibrationOptions& options) {
  // What was recorded after a camera moved is enough for its repair.
  const bool part_of_time = options.kind() != v1::CalibrationOptions::KIND_REPAIR &&
                            (options.from_s() > 0 || options.to_s() > 0);
  return options.what_if() || options.without_cameras_size() > 0 ||
         options.without_sessions_size() > 0 || part_of_time || options.has_assumed_target();
}

// Against what it derives from, or what is active; silent where there is neither.
void ShowDifference(ServerConnection& server, const v1::Calibration& calibration,
                    CommandContext& context) {
  if (context.console.format == OutputFormat::kJson) return;
  std::string parent = calibration.options().parent_id();
  if (parent.empty()) parent = ActiveCalibrationOf(server, calibration.rig()).value_or("");
  if (parent.empty() || parent == calibration.id()) return;
  const auto difference = FetchDifference(server, parent, calibration.id());
  if (difference.ok()) {
    context.console.out << "\n" << FormatDifference(*difference) << std::flush;
  } else {
    context.console.Message(absl::StrCat("no comparison with calibration ", parent, ": ",
                                         std::string(difference.status().message())));
  }
}

// Sessions that were stopped finish once their agents have delivered everything. What else is wrong
// with a session is the server's to say.
void AwaitDrained(ServerConnection& server, const std::vector<std::string>& sessions,
                  CommandContext& context) {
  ProgressLine progress(context.console);
  for (const std::string& id : sessions) {
    const auto get = [&] {
      return SessionOf(server.CallWithId(&v1::SessionService::Stub::GetSession, id));
    };
    const auto has_drained = [&](const v1::Session& now) {
      if (now.state() != v1::Session::STATE_DRAINING) return true;
      progress.Show(absl::StrCat("session ", id, " is being delivered"));
      return false;
    };
    PollUntil(get, has_drained, PollOptions()).IgnoreError();
  }
}

void SayWhatIsNext(const v1::Calibration& calibration, bool what_if, CommandContext& context) {
  if (context.console.format != OutputFormat::kTable) return;
  const std::string& id = calibration.id();
  // A what-if can never become active.
  context.console.Message(absl::StrCat(
      "next: rigcal calibration accuracy ", id, " (the error to expect where), ",
      what_if || calibration.quality().grade() == v1::Quality::GRADE_BAD
          ? ""
          : absl::StrCat("rigcal rig activate ", id, ", "),
      "rigcal calibration export ", id, " --format opencv --output DIR; rigcal calibration get ",
      id, " shows this again"));
}

}  // namespace

ExitCode Calibrate(const CalibrateOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::CreateCalibrationRequest request =
      MakeCalibrationRequest(options.sessions, options.calibration);
  request.set_reason(options.reason);
  request.set_notes(options.notes);
  if (absl::Status status = CompleteOptions(options, server, context, request.mutable_options());
      !status.ok()) {
    return context.Fail(status);
  }
  const bool what_if = IsWhatIf(request.options());
  request.mutable_options()->set_what_if(what_if);
  if (!options.wait && !options.activate) {
    const absl::StatusOr<v1::Calibration> queued =
        CalibrationOf(server.Call(&CalibrationStub::CreateCalibration, request));
    if (!queued.ok()) return context.Fail(queued.status());
    if (context.console.format == OutputFormat::kTable) {
      context.console.Message(absl::StrCat("it is queued; rigcal calibration get ", queued->id(),
                                           " shows how far it is, and the result"));
    }
    return ShowCalibration(*queued, context);
  }
  AwaitDrained(server, options.sessions, context);
  const absl::StatusOr<v1::Calibration> calibration = CalibrateAndWait(server, request, context);
  if (!calibration.ok()) return context.Fail(calibration.status());
  if (calibration->state() == v1::Calibration::STATE_FAILED) {
    context.console.Message(
        absl::StrCat("what the log of the server and its worker says of it has "
                     "correlation id ",
                     OwnCorrelationId()));
  }
  const ExitCode shown = ShowCalibration(*calibration, context);
  if (calibration->state() != v1::Calibration::STATE_SUCCEEDED) return shown;
  if (what_if || calibration->options().kind() != v1::CalibrationOptions::KIND_UNSPECIFIED) {
    ShowDifference(server, *calibration, context);
  }
  if (options.activate) {
    return ActivateIfGood(server, *calibration, options.reason, context);
  }
  SayWhatIsNext(*calibration, what_if, context);
  return shown;
}

namespace {

// "; see the finding wrong_wand_length"; empty: nothing was found that explains it.
std::string MostLikelyCause(const v1::Calibration& calibration) {
  for (const v1::Finding& finding : calibration.findings()) {
    if (finding.severity() == v1::FINDING_SEVERITY_INFO) continue;
    return absl::StrCat(
        "; see the finding ", EnumWord(finding.kind()),
        finding.camera().empty() ? "" : absl::StrCat(" of camera ", finding.camera()));
  }
  return "";
}

}  // namespace

ExitCode ShowCalibration(const v1::Calibration& calibration, CommandContext& context,
                         const GroundTruthComparison* ground_truth) {
  if (context.console.format == OutputFormat::kJson) {
    context.console.out << CalibrationJson(calibration, ground_truth) << "\n" << std::flush;
  } else {
    context.console.Print(absl::StrCat(FormatCalibration(calibration),
                                       ground_truth ? FormatGroundTruthErrors(*ground_truth) : ""));
  }
  if (calibration.state() == v1::Calibration::STATE_FAILED) {
    context.console.Message(
        absl::StrCat("calibration ", calibration.id(), " failed: ", calibration.error()));
    return ExitCode::kFailed;
  }
  if (calibration.state() == v1::Calibration::STATE_CANCELLED) {
    context.console.Message(absl::StrCat("calibration ", calibration.id(), " was cancelled"));
    return ExitCode::kFailed;
  }
  const bool bad = calibration.state() == v1::Calibration::STATE_SUCCEEDED &&
                   calibration.quality().grade() == v1::Quality::GRADE_BAD;
  if (!bad) return ExitCode::kOk;
  const v1::Quality& quality = calibration.quality();
  context.console.Message(
      absl::StrCat("the calibration is graded bad",
                   quality.reasons().empty() ? "" : absl::StrCat(": ", quality.reasons(0)),
                   MostLikelyCause(calibration)));
  return ExitCode::kBelowQualityGate;
}

bool HasEnded(const v1::Calibration& calibration) {
  return calibration.state() >= v1::Calibration::STATE_SUCCEEDED;
}

v1::CreateCalibrationRequest MakeCalibrationRequest(const std::vector<std::string>& sessions,
                                                    const CalibrationOptions& options) {
  v1::CreateCalibrationRequest request;
  for (const std::string& session : sessions) request.add_session_ids(session);
  *request.mutable_options() = wire::ToProto(options);
  return request;
}

}  // namespace rigcal::client
