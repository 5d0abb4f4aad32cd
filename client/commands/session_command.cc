// SPDX-License-Identifier: Apache-2.0
#include "client/commands/session_command.h"

#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/net/paging.h"
#include "client/net/polling.h"
#include "client/net/resources.h"
#include "client/net/server_connection.h"
#include "client/output/output.h"
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

ExitCode Show(const absl::StatusOr<v1::Session>& session, CommandContext& context) {
  if (!session.ok()) return context.Fail(session.status());
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(context.console, *session);
  } else {
    context.console.out << FormatSession(*session);
  }
  return ExitCode::kOk;
}

void WarnOfMissing(const v1::Session& session, CommandContext& context) {
  if (session.missing_cameras().empty()) return;
  context.console.Message(absl::StrCat("session ", session.id(),
                                       " finished without the last observations of ",
                                       absl::StrJoin(session.missing_cameras(), ", ")));
}

template <typename Request>
Request WithId(const std::string& id) {
  Request request;
  request.set_id(id);
  return request;
}

absl::StatusOr<v1::Session> FetchSession(ServerConnection& server, const std::string& id) {
  return SessionOf(
      server.Call(server.sessions(), &SessionStub::GetSession, WithId<v1::GetSessionRequest>(id)));
}

absl::StatusOr<v1::Session> CallStart(ServerConnection& server, const std::string& id) {
  return SessionOf(server.Call(server.sessions(), &SessionStub::StartSession,
                               WithId<v1::StartSessionRequest>(id)));
}

// Prints each message of one stream; true once nothing more is to come.
class WatchPrinter {
 public:
  explicit WatchPrinter(CommandContext& context) : context_(context) {}

  bool finished() const { return finished_; }
  bool has_printed() const { return !last_.empty(); }

  // False to end the stream.
  bool Print(const v1::Session& session) {
    Console& console = context_.console;
    const std::string line = console.format == OutputFormat::kJson
                                 ? ToJson(session, /*indented=*/false)
                                 : FormatSessionLine(session);
    // A stream opened anew begins with what is known already.
    if (line != last_) console.out << line << "\n" << std::flush;
    last_ = line;
    finished_ = session.state() == v1::Session::STATE_FINISHED || !console.out.good();
    if (finished_) WarnOfMissing(session, context_);
    return !finished_;
  }

 private:
  CommandContext& context_;
  std::string last_;
  bool finished_ = false;
};

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
      SessionOf(server.Call(server.sessions(), &SessionStub::CreateSession, request));
  if (session.ok() && options.start) {
    const std::string id = session->id();
    session = CallStart(server, id);
    if (!session.ok()) {
      context.console.Message(
          absl::StrCat("session ", id, " was created but could not be started"));
    }
  }
  return Show(session, context);
}

ExitCode StartSession(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return Show(CallStart(server, id), context);
}

ExitCode StopSession(const SessionStopOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  auto request = WithId<v1::StopSessionRequest>(options.id);
  *request.mutable_drain_timeout() = wire::ToDuration(options.drain_timeout_s);
  absl::StatusOr<v1::Session> session =
      SessionOf(server.Call(server.sessions(), &SessionStub::StopSession, request));
  if (session.ok() && options.wait) {
    ProgressLine progress(context.console);
    session = PollUntil<v1::Session>([&] { return FetchSession(server, options.id); },
                                     [&](const v1::Session& now) {
                                       progress.Show(FormatSessionLine(now));
                                       return now.state() == v1::Session::STATE_FINISHED;
                                     },
                                     {.interval = kRetryInterval,
                                      .patience = kPatience,
                                      .answered_before = false,
                                      .wait = {},
                                      .on_lost = {}});
    progress.Clear();
    if (session.ok()) WarnOfMissing(*session, context);
  }
  return Show(session, context);
}

absl::StatusOr<v1::ListSessionsResponse> ReadAllSessions(ServerConnection& server,
                                                         const ListOptions& options) {
  return ReadAllPages<v1::ListSessionsRequest, v1::ListSessionsResponse>(
      [&](const v1::ListSessionsRequest& request) {
        return server.Call(server.sessions(), &SessionStub::ListSessions,
                           WithListOptions(request, options));
      },
      [](v1::ListSessionsResponse& all, v1::ListSessionsResponse& page) {
        for (v1::Session& session : *page.mutable_sessions()) all.add_sessions()->Swap(&session);
      });
}

ExitCode ListSessions(const ListOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  const auto sessions = ReadAllSessions(server, options);
  if (!sessions.ok()) return context.Fail(sessions.status());
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(context.console, *sessions);
  } else {
    context.console.out << FormatSessionList(sessions->sessions());
  }
  return ExitCode::kOk;
}

ExitCode GetSession(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return Show(FetchSession(server, id), context);
}

ExitCode DeleteSession(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  const auto response = server.Call(server.sessions(), &SessionStub::DeleteSession,
                                    WithId<v1::DeleteSessionRequest>(id));
  if (!response.ok()) return context.Fail(response.status());
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(context.console, *response);
  } else {
    context.console.out << "session " << Printable(id)
                        << " and its observations are deleted; calibrations made from it stay\n";
  }
  return ExitCode::kOk;
}

ExitCode WatchSession(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  WatchPrinter printer(context);
  auto last_contact = std::chrono::steady_clock::now();
  while (true) {
    const absl::Status status = server.Read(server.sessions(), &SessionStub::WatchSession,
                                            WithId<v1::WatchSessionRequest>(id), kStreamTimeout,
                                            [&](const v1::WatchSessionResponse& response) {
                                              last_contact = std::chrono::steady_clock::now();
                                              return printer.Print(response.session());
                                            });
    if (printer.finished()) return ExitCode::kOk;
    if (absl::IsDeadlineExceeded(status)) continue;
    // A stream that ended well before the session did: the server is shutting down.
    const bool away = status.ok() || absl::IsUnavailable(status);
    const bool patient = std::chrono::steady_clock::now() - last_contact < kPatience;
    if (!away || !printer.has_printed() || !patient) {
      if (status.ok()) {
        return context.Fail(absl::UnavailableError(
            absl::StrCat("the server ended the watch of session ", id, " early; try again")));
      }
      return context.Fail(status);
    }
    std::this_thread::sleep_for(kRetryInterval);
  }
}

}  // namespace rigcal::client
