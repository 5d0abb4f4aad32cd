// SPDX-License-Identifier: Apache-2.0
#include "client/commands/session_command.h"

#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/net/polling.h"
#include "client/tables/session_table.h"
#include "common/wire/camera_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::client {
namespace {

using SessionStub = v1::SessionService::Stub;

// A watching stream is opened anew this often, so that a server that went away without a word is
// noticed.
constexpr std::chrono::milliseconds kStreamTimeout{60'000};
constexpr std::chrono::milliseconds kRetryInterval{500};
constexpr std::chrono::milliseconds kPatience{30'000};

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

}  // namespace

ExitCode CreateSession(const SessionCreateOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::CreateSessionRequest request;
  request.set_id(options.id);
  request.set_rig(options.rig);
  request.set_title(options.title);
  *request.mutable_target() = wire::ToProto(options.target);
  for (const std::string& camera : options.cameras) request.add_camera_names(camera);
  absl::StatusOr<v1::Session> session =
      SessionOf(server.Call(&SessionStub::CreateSession, request));
  if (session.ok() && options.start) {
    const std::string id = session->id();
    session = CallStart(server, id);
    if (!session.ok()) {
      context.console.Message(
          absl::StrCat("session ", id, " was created but could not be started"));
    }
  }
  return context.Show(session, FormatSession);
}

ExitCode StartSession(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(CallStart(server, id), FormatSession);
}

ExitCode StopSession(const SessionStopOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::StopSessionRequest request;
  request.set_id(options.id);
  *request.mutable_drain_timeout() = wire::ToDuration(options.drain_timeout_s);
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
  return context.Show(session, FormatSession);
}

ExitCode ListSessions(const ListOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(ReadAllPages(server, &SessionStub::ListSessions, options), FormatSessionList);
}

ExitCode GetSession(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(FetchSession(server, id), FormatSession);
}

ExitCode DeleteSession(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(server.CallWithId(&SessionStub::DeleteSession, id), [&](const auto&) {
    return Printable(absl::StrCat(
        "session ", id, " and its observations are deleted; calibrations made from it stay\n"));
  });
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

}  // namespace rigcal::client
