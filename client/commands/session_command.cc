// SPDX-License-Identifier: Apache-2.0
#include "client/commands/session_command.h"

#include <algorithm>
#include <optional>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/net/polling.h"
#include "client/output/quantities.h"
#include "client/results/observation_folder.h"
#include "client/results/session_verification.h"
#include "client/tables/rig_table.h"
#include "client/tables/session_table.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::client {
namespace {

using SessionStub = v1::SessionService::Stub;

// A watching stream is opened anew this often, so that a server that went away without a word is
// noticed.
constexpr std::chrono::milliseconds kStreamTimeout{60'000};
constexpr std::chrono::milliseconds kRetryInterval{500};
constexpr std::chrono::milliseconds kPatience{30'000};
constexpr std::chrono::milliseconds kPruneTimeout{600'000};  // it gives the space back, too

void WarnOfMissing(const v1::Session& session, CommandContext& context) {
  if (session.missing_cameras().empty()) return;
  context.console.Message(absl::StrCat("session ", session.id(),
                                       " finished without the last observations of ",
                                       absl::StrJoin(session.missing_cameras(), ", ")));
}

absl::StatusOr<v1::Session> FetchSession(ServerConnection& server, const std::string& id) {
  return SessionOf(server.CallWithId(&SessionStub::GetSession, id));
}

absl::StatusOr<v1::Session> CallStart(ServerConnection& server, const std::string& id) {
  return SessionOf(server.CallWithId(&SessionStub::StartSession, id));
}

// Where somebody else was first, the command changes nothing; whoever typed it is told.
void TellOfState(const absl::StatusOr<v1::Session>& before, v1::Session::State wanted,
                 CommandContext& context) {
  if (!before.ok() || before->state() < wanted) return;
  const bool is_start = wanted == v1::Session::STATE_CAPTURING;
  if (is_start && before->state() != wanted) return;  // an error, which the server explains
  const bool has_time = is_start ? before->has_start_time() : before->has_stop_time();
  const auto& time = is_start ? before->start_time() : before->stop_time();
  const std::string& reason = before->stop_reason();
  context.console.Message(
      absl::StrCat("session ", before->id(),
                   is_start ? " had been started already" : " had been stopped already",
                   has_time ? absl::StrCat(", at ", FormatTime(true, time)) : "",
                   is_start || reason.empty() ? "" : ": ", is_start ? "" : reason));
}

// For the whole of a long recording over a slow link.
constexpr std::chrono::milliseconds kReadTimeout{3'600'000};

// Every batch of the session is looked at.
constexpr std::chrono::milliseconds kAuditTimeout{120'000};

void WriteObservationHead(uint32_t marker_count, std::ostream& out) {
  std::string line = "camera,stream_epoch,seq,clock_epoch,time_ns";
  for (uint32_t m = 0; m < marker_count; ++m) absl::StrAppend(&line, ",x", m, "_px,y", m, "_px");
  out << line << "\n";
}

void WriteObservationRows(const ObservationBatch& batch, std::ostream& out) {
  for (size_t row = 0; row < batch.rows(); ++row) {
    std::string line =
        absl::StrCat(batch.stream.camera, ",", batch.stream.stream_epoch, ",",
                     batch.first_seq + row, ",", batch.clock_epoch, ",", batch.time_ns[row]);
    for (uint32_t m = 0; m < batch.marker_count; ++m) {
      const size_t i = row * batch.marker_count + m;
      const bool visible = batch.IsVisible(row, m);
      line += visible ? absl::StrFormat(",%.9g,%.9g", batch.x_px[i], batch.y_px[i]) : ",,";
    }
    out << line << "\n";
  }
}

uint32_t MarkerCount(const v1::Target& target) {
  return static_cast<uint32_t>(std::max(target.points_size(), target.marker_positions_m_size()));
}

// What a person does next.
ExitCode ShowStarted(const absl::StatusOr<v1::Session>& session, CommandContext& context) {
  const ExitCode code = context.Show(session, FormatSession);
  if (!session.ok() || session->state() != v1::Session::STATE_CAPTURING ||
      context.console.format != OutputFormat::kTable) {
    return code;
  }
  context.console.Message(absl::StrCat("wave now; stop with: rigcal session stop ", session->id(),
                                       " --wait (rigcal watch --rig ", session->rig(),
                                       " shows what the cameras see)"));
  return code;
}

absl::StatusOr<SessionVerification> Verify(ServerConnection& server, const std::string& id) {
  v1::GetSessionRequest request;
  request.set_id(id);
  request.set_audit(true);
  const auto response = server.Call(&SessionStub::GetSession, request, kAuditTimeout);
  if (!response.ok()) return response.status();
  // It only helps to say where something is.
  const auto agents = ReadAllPages(server, &v1::AgentService::Stub::ListAgents, ListOptions{});
  return VerifySession(*response, agents.ok() ? *agents : v1::ListAgentsResponse());
}

// Of a session that has finished: what is not on the server, and what a person does next.
ExitCode ShowStopped(ServerConnection& server, const v1::Session& session,
                     CommandContext& context) {
  const auto verified = Verify(server, session.id());
  if (!verified.ok()) return context.Fail(verified.status());
  if (!verified->holds()) {
    for (const VerificationProblem& problem : verified->problems) {
      context.console.Message(
          absl::StrCat("not verified: ", problem.text, "; ", problem.what_to_do));
    }
    context.console.Message(absl::StrCat("next: rigcal session verify ", session.id(),
                                         ", or rigcal calibrate ", session.id(),
                                         " --wait without what is missing"));
    return ExitCode::kNotVerified;
  }
  if (context.console.format == OutputFormat::kTable) {
    context.console.Message(absl::StrCat("next: rigcal calibrate ", session.id(), " --wait"));
  }
  return ExitCode::kOk;
}

ExitCode CreateAndStart(ServerConnection& server, const v1::CreateSessionRequest& request,
                        bool start, CommandContext& context) {
  absl::StatusOr<v1::Session> session =
      SessionOf(server.Call(&SessionStub::CreateSession, request));
  if (session.ok() && start) {
    const std::string id = session->id();
    session = CallStart(server, id);
    if (!session.ok()) {
      context.console.Message(absl::StrCat(
          "session ", id, " was created but not started; the reason is below. To start it later: ",
          "rigcal session start ", id));
    }
  }
  return ShowStarted(session, context);
}

}  // namespace

ExitCode CreateSession(const SessionCreateOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::CreateSessionRequest request;
  request.set_id(options.id);
  request.set_rig(options.rig);
  request.set_title(options.title);
  *request.mutable_target() = wire::ToProto(options.target);
  for (const std::string& camera : options.cameras) request.add_camera_names(camera);
  if (options.until_mm > 0) {
    request.mutable_goal()->set_until_mm(options.until_mm);
    if (options.min_s >= 0) {
      *request.mutable_goal()->mutable_min_duration() = wire::ToDuration(options.min_s);
    }
  }
  request.set_continues(options.continues);
  return CreateAndStart(server, request, options.start, context);
}

ExitCode StartSession(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  TellOfState(FetchSession(server, id), v1::Session::STATE_CAPTURING, context);
  return ShowStarted(CallStart(server, id), context);
}

ExitCode StopSession(const SessionStopOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::StopSessionRequest request;
  request.set_id(options.id);
  *request.mutable_drain_timeout() = wire::ToDuration(options.drain_timeout_s);
  TellOfState(FetchSession(server, options.id), v1::Session::STATE_DRAINING, context);
  absl::StatusOr<v1::Session> session = SessionOf(server.Call(&SessionStub::StopSession, request));
  if (session.ok() && options.wait) {
    ProgressLine progress(context.console);
    session = PollUntil([&] { return FetchSession(server, options.id); },
                        [&](const v1::Session& now) {
                          progress.Show(FormatSessionLine(now));
                          return now.state() == v1::Session::STATE_FINISHED;
                        },
                        {.interval = kRetryInterval, .patience = kPatience});
    progress.Clear();
    if (session.ok()) WarnOfMissing(*session, context);
  }
  const ExitCode code = context.Show(session, FormatSession);
  if (!session.ok()) return code;
  if (session->state() == v1::Session::STATE_FINISHED) {
    return ShowStopped(server, *session, context);
  }
  if (context.console.format == OutputFormat::kTable) {
    context.console.Message(absl::StrCat("next: rigcal session watch ", session->id(),
                                         ", and when it has finished rigcal calibrate ",
                                         session->id(), " --wait"));
  }
  return code;
}

ExitCode ListSessions(const ListOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(ReadAllPages(server, &SessionStub::ListSessions, options), FormatSessionList);
}

ExitCode GetSession(const SessionGetOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(FetchSession(server, options.id),
                      options.all ? FormatWholeSession : FormatSession);
}

ExitCode VerifySessionStreams(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  const auto verified = Verify(server, id);
  if (!verified.ok()) {
    const ExitCode code = context.Fail(verified.status());
    return absl::IsDataLoss(verified.status()) ? ExitCode::kNotVerified : code;
  }
  const SessionVerification& verification = *verified;
  if (context.console.format == OutputFormat::kJson) {
    context.console.out << VerificationJson(verification) << "\n" << std::flush;
  } else {
    context.console.out << FormatVerification(verification) << std::flush;
  }
  return verification.holds() ? ExitCode::kOk : ExitCode::kNotVerified;
}

ExitCode DeleteSession(const SessionDeleteOptions& options, CommandContext& context) {
  const std::string& id = options.id;
  ServerConnection server(context.server);
  if (!options.yes) {
    const absl::StatusOr<v1::Session> session = FetchSession(server, id);
    // One that is damaged can be deleted.
    if (!session.ok() && !absl::IsDataLoss(session.status())) {
      return context.Fail(session.status());
    }
    const std::string rows =
        session.ok()
            ? absl::StrCat(" with ", FormatCount(session->observation_count(), "observation"))
            : "";
    const ExitCode sure = Confirm(context.console, absl::StrCat("delete session ", id, rows));
    if (sure != ExitCode::kOk) return sure;
  }
  return context.Show(server.CallWithId(&SessionStub::DeleteSession, id), [&](const auto&) {
    return Printable(absl::StrCat(
        "session ", id, " and its observations are deleted; calibrations made from it stay\n"));
  });
}

ExitCode DiscardSession(const SessionDiscardOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::DiscardSessionRequest request;
  request.set_id(options.id);
  request.set_undo(options.undo);
  return context.Show(SessionOf(server.Call(&SessionStub::DiscardSession, request)), FormatSession);
}

ExitCode PruneSessions(const SessionPruneOptions& options, CommandContext& context) {
  constexpr double kSecondsPerDay = 86400;
  if (options.older_than_days <= 0 && options.max_mib <= 0) {
    context.console.Message(
        "nothing says which sessions to prune: give --older-than, --max-size or both");
    return ExitCode::kUsage;
  }
  v1::PruneSessionsRequest request;
  request.set_rig(options.rig);
  if (options.older_than_days > 0) {
    *request.mutable_older_than() = wire::ToDuration(options.older_than_days * kSecondsPerDay);
  }
  request.set_max_bytes(static_cast<uint64_t>(options.max_mib * (1 << 20)));
  request.set_include_calibrated(options.include_calibrated);
  request.set_dry_run(options.dry_run);
  ServerConnection server(context.server);
  return context.Show(server.Call(&SessionStub::PruneSessions, request, kPruneTimeout),
                      [&](const v1::PruneSessionsResponse& response) {
                        return FormatPruned(response, options.dry_run);
                      });
}

ExitCode ResumeSession(const SessionResumeOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  const absl::StatusOr<v1::Session> before = FetchSession(server, options.id);
  if (!before.ok()) return context.Fail(before.status());
  v1::CreateSessionRequest request;
  request.set_rig(before->rig());
  request.set_title(before->title());
  *request.mutable_target() = before->target();
  *request.mutable_camera_names() = before->requested_cameras();
  if (options.until_mm > 0) request.mutable_goal()->set_until_mm(options.until_mm);
  request.set_continues(before->id());
  return CreateAndStart(server, request, /*start=*/true, context);
}

ExitCode WatchSession(const std::string& id, CommandContext& context) {
  using Clock = std::chrono::steady_clock;
  ServerConnection server(context.server);
  Console& console = context.console;
  v1::WatchSessionRequest request;
  request.set_id(id);
  std::string last;
  bool finished = false;
  Clock::time_point last_contact = Clock::now();
  const auto print = [&](const v1::WatchSessionResponse& response) {
    last_contact = Clock::now();
    const v1::Session& session = response.session();
    const std::string line = console.format == OutputFormat::kJson
                                 ? ToJson(session, /*indented=*/false)
                                 : FormatSessionLine(session);
    // A stream opened anew begins with what is known already.
    if (line != last) console.out << line << "\n" << std::flush;
    last = line;
    finished = session.state() == v1::Session::STATE_FINISHED || !console.out.good();
    if (finished) WarnOfMissing(session, context);
    return !finished;
  };
  while (true) {
    absl::Status status = server.Read(&SessionStub::WatchSession, request, kStreamTimeout, print);
    if (finished) return ExitCode::kOk;
    if (absl::IsDeadlineExceeded(status)) continue;
    // A stream that ended well before the session did: the server is shutting down.
    if (status.ok()) {
      status = absl::UnavailableError(
          absl::StrCat("the server ended the watch of session ", id, " early; try again"));
    }
    const bool patient = Clock::now() - last_contact < kPatience;
    if (!absl::IsUnavailable(status) || last.empty() || !patient) return context.Fail(status);
    std::this_thread::sleep_for(kRetryInterval);
  }
}

ExitCode WriteSessionObservations(const SessionObservationsOptions& options,
                                  CommandContext& context) {
  ServerConnection server(context.server);
  Console& console = context.console;
  const auto session = SessionOf(server.CallWithId(&SessionStub::GetSession, options.session));
  if (!session.ok()) return context.Fail(session.status());
  std::optional<ObservationFolder> folder;
  if (!options.output.empty()) {
    folder.emplace(options.output, options.force);
    std::vector<v1::CameraDescription> cameras;
    for (const v1::SessionCamera& camera : session->cameras()) {
      const bool wanted = options.camera.empty() || options.camera == camera.description().camera();
      if (wanted) cameras.push_back(camera.description());
    }
    if (cameras.empty()) {
      return context.Fail(absl::FailedPreconditionError(
          absl::StrCat("session ", options.session, " has no ",
                       options.camera.empty() ? "cameras: nothing has been captured"
                                              : absl::StrCat("camera ", options.camera))));
    }
    if (absl::Status status = folder->Begin(cameras); !status.ok()) return context.Fail(status);
  } else if (console.format == OutputFormat::kTable) {
    WriteObservationHead(MarkerCount(session->target()), console.out);
  }

  v1::ReadObservationsRequest request;
  request.set_session_id(options.session);
  request.set_camera(options.camera);
  request.set_include_late(options.include_late);
  absl::Status fault, written;
  const absl::Status status =
      server.Read(&SessionStub::ReadObservations, request, kReadTimeout,
                  [&](const v1::ReadObservationsResponse& response) {
                    const v1::ObservationBatch& message = response.batch();
                    if (!folder && console.format == OutputFormat::kJson) {
                      console.out << ToJson(message, /*indented=*/false) << "\n";
                      return console.out.good();
                    }
                    const absl::StatusOr<ObservationBatch> batch = wire::FromProto(message);
                    fault = batch.status();
                    if (batch.ok() && folder) {
                      written = folder->Add(*batch);
                    } else if (batch.ok()) {
                      WriteObservationRows(*batch, console.out);
                    }
                    return batch.ok() && written.ok() && console.out.good();
                  });
  console.out.flush();
  if (!status.ok()) return context.Fail(status);
  if (folder && written.ok() && fault.ok()) written = folder->Finish();
  if (!written.ok()) return context.Fail(written);
  if (!fault.ok()) {
    return context.Fail(
        absl::DataLossError(absl::StrCat("the server sent a batch of session ", options.session,
                                         " that cannot be read: ", std::string(fault.message()))));
  }
  if (folder) {
    for (const std::string& note : folder->notes()) console.Message(note);
    PrintFiles("session", options.session, folder->files(), context);
  }
  return ExitCode::kOk;
}

}  // namespace rigcal::client
