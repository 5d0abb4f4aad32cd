// SPDX-License-Identifier: Apache-2.0
#include "client/watch/watch_command.h"

#include <chrono>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "client/local/stop_signal.h"
#include "client/net/server_connection.h"
#include "client/output/quantities.h"
#include "client/watch/live_mirror.h"
#include "client/watch/live_text.h"
#include "client/watch/terminal.h"
#include "client/watch/watch_keys.h"
#include "rigcal/v1/live_service.grpc.pb.h"

namespace rigcal::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kUnseenLimit{5};
constexpr std::chrono::milliseconds kPollInterval{250};
constexpr std::chrono::milliseconds kLineInterval{1000};
constexpr std::chrono::milliseconds kAnswerTimeout{3000};

// What the server says, again and again.
class Follower {
 public:
  Follower(ServerConnection* server, const WatchOptions& options)
      : server_(*server), options_(options) {}

  // Asks once. An error that trying again does not cure.
  absl::Status Poll() {
    v1::GetLiveRequest request;
    request.set_rig(options_.rig);
    request.set_since_revision(mirror_.state().revision());
    const auto response = server_.Call(&v1::LiveService::Stub::GetLive, request, kAnswerTimeout);
    if (response.ok()) {
      problem_.clear();
      contact_ = Clock::now();
      mirror_.Merge(response->live());
      seen_ = seen_ || state().session().id() == options_.session;
      return absl::OkStatus();
    }
    problem_ = std::string(response.status().message());
    const bool passes =
        absl::IsUnavailable(response.status()) || absl::IsDeadlineExceeded(response.status());
    return passes && contact_ ? absl::OkStatus() : response.status();
  }

  const v1::LiveState& state() const { return mirror_.state(); }
  const std::string& problem() const { return problem_; }
  double age_s() const {
    return contact_ ? std::chrono::duration<double>(Clock::now() - *contact_).count() : 0;
  }
  // The session that was asked for has finished, or is not the live one any more.
  bool IsOver() const {
    if (options_.session.empty() || !state().full()) return false;
    // The live state shows a new session a moment after it was created.
    if (!seen_ && Clock::now() - begin_ < kUnseenLimit) return false;
    return state().session().id() != options_.session ||
           state().session().state() == v1::Session::STATE_FINISHED;
  }

 private:
  ServerConnection& server_;
  const WatchOptions& options_;
  const Clock::time_point begin_ = Clock::now();
  LiveMirror mirror_;
  bool seen_ = false;  // the session that was asked for
  std::string problem_;
  std::optional<Clock::time_point> contact_;
};

// Stops the live session; what has happened, in words.
std::string StopLiveSession(const v1::LiveState& live, ServerConnection& server) {
  if (!live.has_session()) return "there is no session to stop";
  const v1::Session& session = live.session();
  v1::StopSessionRequest request;
  request.set_id(session.id());
  const auto stopped =
      SessionOf(server.Call(&v1::SessionService::Stub::StopSession, request, kAnswerTimeout));
  if (!stopped.ok()) return std::string(stopped.status().message());
  const std::string when = FormatTime(stopped->has_stop_time(), stopped->stop_time());
  if (session.state() == v1::Session::STATE_CAPTURING) {
    return absl::StrCat("session ", session.id(), " stopped at ", when,
                        stopped->stop_reason().empty() ? "" : ": ", stopped->stop_reason());
  }
  return absl::StrCat("session ", session.id(), " had been stopped already, at ", when);
}

ExitCode WatchOnTerminal(Follower* follower, bool all, ServerConnection& server,
                         CommandContext& context) {
  const bool colour = Terminal::HasColour();
  std::string message;
  std::string result;  // of the last stop; also said when the screen is gone
  WatchKeys keys;
  absl::Status status;
  {
    const StopSignals signals;
    Terminal terminal;
    while (StopSignals::Received() == 0) {
      status = follower->Poll();
      if (!status.ok()) break;
      terminal.Show(FormatLiveScreen(follower->state(), {.columns = terminal.columns(),
                                                         .rows = terminal.rows(),
                                                         .colour = colour,
                                                         .all = all,
                                                         .server = context.server,
                                                         .age_s = follower->age_s(),
                                                         .problem = follower->problem(),
                                                         .message = message}));
      const char key = terminal.WaitForKey(kPollInterval);
      const v1::LiveState& live = follower->state();
      const std::string session = live.has_session() ? live.session().id() : "";
      const WatchKeys::Act act = keys.Press(key, session);
      if (act == WatchKeys::Act::kLeave) break;
      if (act == WatchKeys::Act::kKeep) message = "the session goes on";
      if (act == WatchKeys::Act::kStop) message = result = StopLiveSession(live, server);
      if (act == WatchKeys::Act::kAsk) {
        message = session.empty() ? "there is no session to stop"
                                  : absl::StrCat("stop session ", session,
                                                 "? y stops it, any other key lets it go on");
      }
    }
  }
  if (!status.ok()) return context.Fail(status);
  if (!result.empty()) context.console.Message(result);
  return ExitCode::kOk;
}

ExitCode WatchAsLines(Follower* follower, CommandContext& context) {
  Console& console = context.console;
  const StopSignals signals;
  while (StopSignals::Received() == 0) {
    if (const absl::Status status = follower->Poll(); !status.ok()) return context.Fail(status);
    if (!follower->problem().empty()) {
      console.Message(absl::StrCat("the server has not answered for ",
                                   FormatFixed(follower->age_s(), 0), " s (", follower->problem(),
                                   "); trying again"));
    } else if (console.format == OutputFormat::kJson) {
      console.out << ToJson(follower->state(), /*indented=*/false) << "\n" << std::flush;
    } else {
      console.out << FormatLiveLine(follower->state()) << "\n" << std::flush;
    }
    if (!console.out.good() || follower->IsOver()) break;
    signals.Sleep(kLineInterval);
  }
  return ExitCode::kOk;
}

}  // namespace

ExitCode WatchLive(const WatchOptions& asked, CommandContext& context) {
  ServerConnection server(context.server);
  WatchOptions options = asked;
  if (!options.session.empty()) {
    const auto session =
        SessionOf(server.CallWithId(&v1::SessionService::Stub::GetSession, options.session));
    if (!session.ok()) return context.Fail(session.status());
    if (!options.rig.empty() && options.rig != session->rig()) {
      return context.Fail(absl::InvalidArgumentError(absl::StrCat(
          "session ", options.session, " is of rig ", session->rig(), ", not of ", options.rig)));
    }
    options.rig = session->rig();
  }
  Follower follower(&server, options);
  // Before the screen is taken, so that a wrong address is said as by any other command.
  if (const absl::Status status = follower.Poll(); !status.ok()) return context.Fail(status);
  if (context.console.format == OutputFormat::kTable && Terminal::IsThere()) {
    return WatchOnTerminal(&follower, options.all, server, context);
  }
  return WatchAsLines(&follower, context);
}

void AddWatchCommand(CommandParser& parser) {
  auto [app, options] =
      parser.AddCommand(nullptr, "watch",
                        "The rig while you wave: expected error in mm, cameras, advice, alerts "
                        "(keys s, then y: stop the "
                        "session, q: leave); without a terminal a line each second",
                        WatchLive);
  AddOption(app, "--rig", "RIG", &options->rig, "Rig to watch; without it \"rig\"");
  AddOption(app, "--session", "SESSION", &options->session,
            "Watch the rig of this session, without a terminal until it has finished");
  app->add_flag(
      "--all", options->all,
      "Cameras by name and all alerts; without it, of more than 16 cameras, those first that "
      "need something");
}

}  // namespace rigcal::client
