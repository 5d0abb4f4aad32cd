// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "client/commands/doctor_command.h"
#include "common/enrolment/https_call.h"
#include "common/enrolment/join_server.h"
#include "common/identity/identity_folder.h"
#include "common/wire/server_access.h"

namespace rigcal::client {
namespace {

constexpr std::chrono::milliseconds kProbeTimeout{3000};
constexpr absl::Duration kClockTolerance = absl::Minutes(5);
constexpr char kJoinAgain[] =
    "on the server PC `rigcal token create --role operator` prints a new join string; use it here: "
    "rigcal login STRING";

std::string DayOf(absl::Time time) {
  return absl::FormatTime("%Y-%m-%d %H:%M", time, absl::UTCTimeZone());
}

std::string ClockText(absl::Duration ahead) {
  const std::string amount =
      absl::AbsDuration(ahead) > absl::Hours(48)
          ? absl::StrCat(absl::ToInt64Hours(absl::AbsDuration(ahead)) / 24, " days")
          : absl::FormatDuration(absl::Trunc(absl::AbsDuration(ahead), absl::Seconds(1)));
  return absl::StrCat("the clock of this PC is ", amount,
                      ahead > absl::ZeroDuration() ? " ahead of" : " behind",
                      " that of the server");
}

Check Failed(std::string message, std::string advice) {
  return {CheckLevel::kFail, "connection", std::move(message), std::move(advice)};
}

Check ExpiredServer(const ConnectionFacts& facts, const std::string& end) {
  if (facts.clock_ahead && absl::AbsDuration(*facts.clock_ahead) > kClockTolerance) {
    return Failed(absl::StrCat(end, ", and ", ClockText(*facts.clock_ahead)),
                  "set the clock of this PC: timedatectl set-ntp true, or date -s");
  }
  return Failed(end, "start rigcal-server again, which renews it; is the server's clock right?");
}

Check RefusedClient(const ConnectionFacts& facts) {
  if (!facts.identity_fault.ok()) {
    return Failed("the server wants a certificate, and that of this user cannot be used",
                  kJoinAgain);
  }
  if (!facts.has_identity) {
    return Failed("the server wants a certificate, and this user has none", kJoinAgain);
  }
  if (!facts.renewal.ok() && !absl::IsUnavailable(facts.renewal)) {
    return Failed(absl::StrCat("the server does not take the certificate of this user: ",
                               std::string(facts.renewal.message())),
                  kJoinAgain);
  }
  if (facts.own_end && *facts.own_end < absl::Now()) {
    return Failed(
        absl::StrCat("the certificate of this user ended at ", DayOf(*facts.own_end),
                     " UTC, and could not be renewed: ", std::string(facts.renewal.message())),
        "let the HTTPS port of the server (7421) through the firewall, and try again; "
        "else join again with rigcal login");
  }
  return Failed(absl::StrCat("the server closes the connection when it has seen the certificate of "
                             "this user (",
                             facts.probe.detail, ")"),
                "the server's log and its audit.jsonl say why");
}

}  // namespace

Check ExplainConnection(const ConnectionFacts& facts) {
  const std::string& address = facts.address;
  const std::optional<Certificate>& server = facts.probe.server;
  switch (facts.probe.fault) {
    case TlsFault::kNone:
      if (absl::IsPermissionDenied(facts.renewal) || absl::IsUnauthenticated(facts.renewal)) {
        return RefusedClient(facts);
      }
      return {CheckLevel::kOk, "connection",
              facts.has_identity ? "TLS works, and the server takes this user's certificate"
                                 : "a TLS server answers"};
    case TlsFault::kUnknownHost:
      return Failed(
          absl::StrCat("the name in ", address, " has no address (", facts.probe.detail, ")"),
          "use the server's address instead of its name, or add it to /etc/hosts");
    case TlsFault::kPortClosed:
      return Failed(
          absl::StrCat("the PC of ", address, " answers, but nothing listens on that port"),
          "is rigcal-server running there, with --listen 0.0.0.0:7420?");
    case TlsFault::kNoAnswer:
      return Failed(absl::StrCat("no answer from ", address, " (", facts.probe.detail, ")"),
                    "is that PC on, is the address right, and does its firewall let TCP 7420 and "
                    "7421 in?");
    case TlsFault::kPlaintext:
      return Failed(absl::StrCat("the server at ", address, " does not use TLS"),
                    "it is not a rigcal-server, or it serves its own PC only: start it with "
                    "--listen 0.0.0.0:7420");
    case TlsFault::kOtherCa:
      return Failed(absl::StrCat("the server at ", address,
                                 " is not the one that this user has "
                                 "joined: its certificate is of another CA (",
                                 facts.probe.detail, ")"),
                    absl::StrCat("if the server was set up again, ", kJoinAgain,
                                 "; else somebody else answers at this address"));
    case TlsFault::kWrongName:
      return Failed(
          absl::StrCat("the server's certificate is not for ", address, ": it names ",
                       server ? absl::StrJoin(server->hosts, ", ") : "nothing"),
          "use one of these with --server; a server that listens on 0.0.0.0 adds a new address of "
          "its PC within a minute");
    case TlsFault::kExpired:
      return ExpiredServer(facts, absl::StrCat("the server's certificate ended at ",
                                               server ? DayOf(server->not_after) : "?",
                                               " UTC, by the clock of this PC"));
    case TlsFault::kNotYetValid:
      return ExpiredServer(facts, absl::StrCat("the server's certificate begins at ",
                                               server ? DayOf(server->not_before) : "?",
                                               " UTC, by the clock of this PC"));
    case TlsFault::kClientRefused:
      return RefusedClient(facts);
    case TlsFault::kBroken:
      break;
  }
  return Failed(absl::StrCat("TLS with ", address, " fails: ", facts.probe.detail),
                "is it a rigcal-server?");
}

std::optional<Check> CheckClock(const ConnectionFacts& facts) {
  if (!facts.clock_ahead) return std::nullopt;
  if (absl::AbsDuration(*facts.clock_ahead) <= kClockTolerance) {
    return Check{CheckLevel::kOk, "clock", "as the server's, within 5 minutes"};
  }
  return Check{CheckLevel::kWarn, "clock", ClockText(*facts.clock_ahead),
               "observations are not harmed by it; set it for readable logs and certificates"};
}

bool UsesTls(const std::string& address) {
  if (!wire::IsOnThisMachine(address)) return true;
  const absl::StatusOr<PeerIdentity> identity = IdentityFolder::OfUser(UserConfigFolder()).Load();
  return identity.ok() && std::ranges::find(identity->grpc, address) != identity->grpc.end();
}

ConnectionFacts GatherConnectionFacts(const std::string& address) {
  ConnectionFacts facts{.address = address};
  const IdentityFolder folder = IdentityFolder::OfUser(UserConfigFolder());
  const absl::StatusOr<PeerIdentity> identity = folder.Load();
  facts.has_identity = identity.ok();
  if (folder.Exists()) facts.identity_fault = identity.status();
  facts.probe = ProbeTls(address, identity.ok() ? &*identity : nullptr, kProbeTimeout);
  if (!identity.ok()) return facts;
  const absl::StatusOr<Certificate> own = ParseCertificate(identity->certificate_pem);
  if (own.ok()) facts.own_end = own->not_after;
  for (const std::string& https : identity->https) {
    const auto answer = CallHttps({.address = https,
                                   .method = "GET",
                                   .path = "/healthz",
                                   .ca_pem = identity->ca_pem,
                                   .timeout = kProbeTimeout});
    if (!answer.ok() || !answer->server_time) continue;
    facts.clock_ahead = absl::Now() - *answer->server_time;
    break;
  }
  // A server that refuses the certificate, at once or after the handshake, says why when it is
  // asked to renew it.
  const auto renewed = RenewIdentity(*identity, kProbeTimeout);
  facts.renewal = renewed.status();
  if (renewed.ok() && renewed->has_value()) facts.renewal = folder.Renew(**renewed);
  return facts;
}

namespace {

Check CheckAgentIdentity(const IdentityFolder& folder) {
  Check check{CheckLevel::kFail, "identity", "", ""};
  const std::string again =
      absl::StrCat("use it here: rigcal-agent join STRING --force --state-dir ",
                   folder.path().parent_path().string());
  const absl::StatusOr<PeerIdentity> identity = folder.Load();
  if (!identity.ok()) {
    check.message = std::string(identity.status().message());
    check.advice =
        "on the server PC `rigcal token create --name AGENT` prints a new join string; " + again;
    return check;
  }
  const absl::StatusOr<Certificate> certificate = ParseCertificate(identity->certificate_pem);
  const std::string name = certificate.ok() ? certificate->name : "?";
  const auto renewed = RenewIdentity(*identity, kProbeTimeout);
  if (renewed.ok()) {
    if (renewed->has_value()) (void)folder.Renew(**renewed).ok();
    return {CheckLevel::kOk, "identity",
            absl::StrCat("agent ", name, ": its server takes its certificate")};
  }
  check.message = absl::StrCat("agent ", name, ": ", std::string(renewed.status().message()));
  if (absl::IsUnavailable(renewed.status())) {
    check.level = CheckLevel::kWarn;
    check.advice = "its server cannot be asked whether it takes the agent's certificate";
  } else {
    check.advice = absl::StrCat("on the server PC `rigcal token create --name ", name,
                                "` prints a new join string; ", again);
  }
  return check;
}

}  // namespace

std::optional<Check> CheckAgentPc(const std::string& address, const absl::Status& status) {
  if (!absl::IsUnavailable(status) || !wire::IsOnThisMachine(address) ||
      IdentityFolder::OfUser(UserConfigFolder()).Exists() || DefaultAgentIdentities().empty()) {
    return std::nullopt;
  }
  return Check{CheckLevel::kWarn, "server",
               absl::StrCat("none runs on this PC (", address,
                            "), and this user has not joined one; the agents of this PC have: "
                            "see identity below"),
               absl::StrCat("to use rigcal here too: ", kJoinAgain)};
}

std::vector<Check> CheckIdentities() {
  std::vector<Check> checks;
  const IdentityFolder own = IdentityFolder::OfUser(UserConfigFolder());
  if (own.Exists()) {
    if (const absl::Status fault = own.Load().status(); !fault.ok()) {
      checks.push_back({CheckLevel::kFail, "identity", std::string(fault.message()), kJoinAgain});
    }
  }
  for (const IdentityFolder& folder : DefaultAgentIdentities()) {
    checks.push_back(CheckAgentIdentity(folder));
  }
  return checks;
}

}  // namespace rigcal::client
