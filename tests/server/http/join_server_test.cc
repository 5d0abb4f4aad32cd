// SPDX-License-Identifier: Apache-2.0
#include "common/enrolment/join_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_replace.h"
#include "common/enrolment/connection_refusal.h"
#include "common/enrolment/https_call.h"
#include "common/enrolment/renewal_thread.h"
#include "common/file/durable_file.h"
#include "common/identity/certificate_request.h"
#include "common/identity/private_key.h"
#include "server/http/identity_routes.h"
#include "server/identity/server_identity.h"
#include "tests/server/http/join_fixture.h"
#include "tests/testing/issued_before.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::join_server_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

class JoinServer : public JoinFixture {
 protected:
  // Of an agent that joined so long ago, by its own clock and the server's.
  PeerIdentity JoinedBefore(absl::Duration ago) {
    PeerIdentity identity = *rigcal::JoinServer(MakeJoin(), "pc-1");
    identity.certificate_pem = IssuedBefore(
        folder(), {Role::kAgent, "pc-1", PublicKeyOf(identity.certificate_pem)}, Now() - ago);
    return identity;
  }
};

TEST_F(JoinServer, GetsAnIdentity) {
  StartServer();
  ASSERT_OK_AND_ASSIGN(const PeerIdentity identity, rigcal::JoinServer(MakeJoin(), "pc-1"));
  EXPECT_THAT(CheckIdentity(identity), IsOk());
  EXPECT_EQ(identity.ca_pem, authority().ca_pem());
  EXPECT_THAT(identity.https, ElementsAre(address()));
  EXPECT_THAT(identity.grpc, ElementsAre("127.0.0.1:7420"));
  EXPECT_THAT(authority().ListIdentities(), SizeIs(1));
}

TEST_F(JoinServer, TriesEachHost) {
  StartServer();
  rigcal::JoinString join = MakeJoin();
  // .invalid never resolves (RFC 2606).
  join.hosts = {"nowhere.invalid", "127.0.0.1"};
  EXPECT_THAT(rigcal::JoinServer(join, "pc-1"), IsOk());
}

TEST_F(JoinServer, SaysWhereNobodyAnswers) {
  StartServer();
  const rigcal::JoinString join = MakeJoin();
  StopServer();
  EXPECT_THAT(rigcal::JoinServer(join, "pc-1"),
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr(address()), HasSubstr("refused"), HasSubstr("firewall"))));
}

TEST_F(JoinServer, IsToldWhyTheServerRefuses) {
  StartServer();
  const rigcal::JoinString used = MakeJoin();
  ASSERT_THAT(rigcal::JoinServer(used, "pc-1"), IsOk());
  EXPECT_THAT(rigcal::JoinServer(used, "pc-2"),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("already used")));
  rigcal::JoinString unknown = MakeJoin();
  unknown.secret[0] = static_cast<char>(unknown.secret[0] ^ 1);
  EXPECT_THAT(rigcal::JoinServer(unknown, "pc-2"),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("not known here")));
  rigcal::JoinString forged = MakeJoin(Role::kViewer);
  forged.role = Role::kOperator;
  EXPECT_THAT(rigcal::JoinServer(forged, "anna"),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("viewer")));
}

TEST_F(JoinServer, IsTooLateWithAnExpiredString) {
  // The expiry counts by the server's clock, which is ahead of the one here.
  StartServer(absl::Hours(24));
  const rigcal::JoinString join = MakeJoin(Role::kAgent, "", absl::Seconds(1));
  absl::SleepFor(absl::Seconds(2));
  EXPECT_THAT(rigcal::JoinServer(join, "pc-1"),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("expired")));
}

TEST_F(JoinServer, SendsNothingToAServerWithAnotherCa) {
  StartServer();
  rigcal::JoinString join = MakeJoin();
  join.ca_sha256[5] = static_cast<char>(join.ca_sha256[5] ^ 1);
  EXPECT_THAT(rigcal::JoinServer(join, "pc-1"),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("not the one that made"), HasSubstr("Nothing was sent"))));
  EXPECT_THAT(authority().ListIdentities(), SizeIs(0));
}

// It shows the true CA, which anybody may fetch, and cannot have a certificate of it.
TEST_F(JoinServer, SendsNothingToAServerThatOnlyShowsTheCa) {
  StartServer();
  rigcal::JoinString join = MakeJoin();
  TemporaryDirectory data;
  ASSERT_THAT(server::EnsureServerIdentity(data.path(), {"127.0.0.1"}), IsOk());
  std::atomic<int> enrolments = 0;
  server::HttpServer thief(
      {.listen_address = "127.0.0.1:0",
       .certificate_file = data.path() / "identity" / "server.crt",
       .key_file = data.path() / "identity" / "server.key"},
      std::vector<server::HttpRoute>{{"GET", "/v1/ca",
                                      [this](const server::HttpRequest&) {
                                        return server::HttpResponse{.body = authority().ca_pem()};
                                      }},
                                     {"POST", "/v1/enrol", [&](const server::HttpRequest&) {
                                        ++enrolments;
                                        return server::HttpResponse{};
                                      }}});
  ASSERT_OK_AND_ASSIGN(const int port, thief.Start());
  join.https_port = static_cast<uint16_t>(port);
  EXPECT_THAT(rigcal::JoinServer(join, "pc-1"),
              StatusIs(absl::StatusCode::kUnauthenticated,
                       AllOf(HasSubstr("nothing was sent"), HasSubstr("CA"))));
  EXPECT_EQ(enrolments, 0);
}

// Somebody between who joins and the server: shows what he likes as the CA, and has a certificate
// of a CA of his own.
class Impostor {
 public:
  explicit Impostor(std::string ca_answer) : ca_answer_(std::move(ca_answer)) {
    EXPECT_THAT(server::EnsureServerIdentity(data_.path(), {"127.0.0.1"}), IsOk());
    server_ = std::make_unique<server::HttpServer>(
        server::HttpServerOptions{.listen_address = "127.0.0.1:0",
                                  .certificate_file = folder() / "server.crt",
                                  .key_file = folder() / "server.key"},
        std::vector<server::HttpRoute>{
            {"GET", "/v1/ca",
             [this](const server::HttpRequest&) {
               return server::HttpResponse{.body = ca_answer_};
             }},
            {"POST", "/v1/enrol", [this](const server::HttpRequest& request) {
               seen_ += request.body;
               return server::HttpResponse{};
             }}});
    const auto port = server_->Start();
    EXPECT_THAT(port, IsOk());
    port_ = *port;
  }

  uint16_t port() const { return static_cast<uint16_t>(port_); }
  void SetCaAnswer(std::string text) { ca_answer_ = std::move(text); }
  std::string ca() const { return server::CertificateAuthority::Open(folder())->pem(); }
  std::string certificate() const { return *ReadSmallFile(folder() / "server.crt"); }
  // What was sent to /v1/enrol. Only after the server is gone.
  std::string Seen() {
    server_.reset();
    return seen_;
  }

 private:
  std::filesystem::path folder() const { return data_.path() / "identity"; }

  TemporaryDirectory data_;
  std::string ca_answer_;
  std::string seen_;
  std::unique_ptr<server::HttpServer> server_;
  int port_ = 0;
};

TEST_F(JoinServer, SendsNothingToAnImpostorWhoAddsHisOwnCa) {
  StartServer();
  Impostor impostor("");
  const std::string ca = authority().ca_pem();
  const std::string his = impostor.ca();
  const std::string trusted = absl::StrReplaceAll(his, {{"CERTIFICATE", "TRUSTED CERTIFICATE"}});
  rigcal::JoinString join = MakeJoin();
  const uint16_t real_port = join.https_port;
  join.https_port = impostor.port();
  for (const std::string& answer :
       {ca + his, his + ca, ca + "\n" + his, ca + ca, ca + ca + his,
        ca + impostor.certificate() + his, impostor.certificate() + his + ca, "text\n" + ca,
        ca + "text\n", ca + "text\n" + his, ca + trusted, trusted + ca,
        ca + std::string(1, '\0') + his}) {
    impostor.SetCaAnswer(answer);
    EXPECT_THAT(rigcal::JoinServer(join, "pc-1"),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr("127.0.0.1"), HasSubstr("Nothing was sent"))))
        << answer;
  }
  // What is right in itself is of no use to him.
  impostor.SetCaAnswer(ca);
  EXPECT_THAT(rigcal::JoinServer(join, "pc-1"),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("nothing was sent")));
  EXPECT_EQ(impostor.Seen(), "") << "the secret was sent to him";
  join.https_port = real_port;
  ASSERT_OK_AND_ASSIGN(const PeerIdentity identity, rigcal::JoinServer(join, "pc-1"));
  EXPECT_EQ(identity.ca_pem, ca) << "the join string is still good";
}

// Another program has the address: a firewall is not the cause.
TEST_F(JoinServer, NamesAnotherProgramAtTheAddress) {
  StartServer();
  // Where nobody was asked, nobody answered.
  PeerIdentity nowhere = *rigcal::JoinServer(MakeJoin(), "pc-1");
  nowhere.https.clear();
  EXPECT_THAT(RenewIdentity(nowhere),
              StatusIs(absl::StatusCode::kUnavailable, Not(HasSubstr("Another program"))));
  Impostor impostor("");
  rigcal::JoinString join = MakeJoin();
  join.https_port = impostor.port();
  for (const std::string& answer : {std::string("<html>"), std::string(300'000, 'x')}) {
    impostor.SetCaAnswer(answer);
    EXPECT_THAT(rigcal::JoinServer(join, "pc-1"),
                StatusIs(absl::StatusCode::kUnavailable,
                         AllOf(HasSubstr("no rigcal server"), HasSubstr("Another program"),
                               Not(HasSubstr("firewall")))));
  }
}

// Who gives a text of two certificates as the CA trusts neither.
TEST_F(JoinServer, ACallTrustsOneCertificate) {
  StartServer();
  const Impostor impostor("");
  for (const std::string& both :
       {authority().ca_pem() + impostor.ca(), impostor.ca() + authority().ca_pem()}) {
    for (const int port : {static_cast<int>(impostor.port()), this->port()}) {
      EXPECT_THAT(CallHttps({.address = "127.0.0.1:" + std::to_string(port),
                             .method = "GET",
                             .path = "/v1/ca",
                             .ca_pem = both}),
                  StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("holds 2 PEM blocks")));
    }
  }
}

// The answer to a renewal comes from the server itself; a chain in it must not be kept all the
// same.
TEST_F(JoinServer, TakesOneCertificateAndNoChain) {
  StartServer();
  const PeerIdentity joined = JoinedBefore(absl::Hours(24 * 25));
  const auto ca = server::CertificateAuthority::Open(folder());
  const std::string fresh =
      *ca->IssuePeer({Role::kAgent, "pc-1", PublicKeyOf(joined.certificate_pem)}, Now());
  TemporaryDirectory data;
  std::string certificate;
  const auto answer = [&](const server::HttpRequest&) {
    const std::string text = absl::StrReplaceAll(certificate, {{"\n", "\\n"}});
    return server::HttpResponse{.body = R"({"certificate": ")" + text +
                                        R"(", "grpc": [], "https": []})"};
  };
  const std::string key = *MakePrivateKey();
  server::HttpServer chatty({.listen_address = "127.0.0.1:0",
                             .certificate_file = data.WriteFile(
                                 "server.crt", *ca->IssueServer(key, {"127.0.0.1"}, Now())),
                             .key_file = data.WriteFile("server.key", key)},
                            std::vector<server::HttpRoute>{{"POST", "/v1/renew", answer}});
  ASSERT_OK_AND_ASSIGN(const int port, chatty.Start());
  PeerIdentity identity = joined;
  identity.https = {"127.0.0.1:" + std::to_string(port)};
  for (const std::string& several :
       {fresh + ca->pem(), ca->pem() + fresh, fresh + fresh, "text\n" + fresh, fresh + "text"}) {
    certificate = several;
    EXPECT_THAT(RenewIdentity(identity),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("certificate")))
        << several;
  }
  certificate = fresh + "\n\n";
  ASSERT_OK_AND_ASSIGN(const auto renewed, RenewIdentity(identity));
  ASSERT_TRUE(renewed.has_value());
  EXPECT_EQ(renewed->certificate_pem, fresh);
  EXPECT_EQ(renewed->https, identity.https) << "an answer without addresses leaves the old ones";
  identity.ca_pem += Impostor("").ca();
  EXPECT_FALSE(RenewIdentity(identity).ok()) << "an old folder that trusts two asks nobody";
}

// An agent's own certificate is of the right CA, and must not do for a server.
TEST_F(JoinServer, SendsNothingToAnAgentThatPlaysTheServer) {
  StartServer();
  ASSERT_OK_AND_ASSIGN(const PeerIdentity agent, rigcal::JoinServer(MakeJoin(), "pc-1"));
  TemporaryDirectory data;
  const auto certificate = data.WriteFile("agent.crt", agent.certificate_pem);
  const auto key = data.WriteFile("agent.key", agent.key_pem);
  server::HttpServer thief(
      {.listen_address = "127.0.0.1:0", .certificate_file = certificate, .key_file = key},
      std::vector<server::HttpRoute>{{"GET", "/v1/ca", [this](const server::HttpRequest&) {
                                        return server::HttpResponse{.body = authority().ca_pem()};
                                      }}});
  ASSERT_OK_AND_ASSIGN(const int port, thief.Start());
  rigcal::JoinString join = MakeJoin();
  join.https_port = static_cast<uint16_t>(port);
  EXPECT_THAT(rigcal::JoinServer(join, "pc-2"),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("nothing was sent")));
}

TEST_F(JoinServer, SendsNothingToAServerOfAnotherName) {
  StartServer();
  const auto ca = server::CertificateAuthority::Open(folder());
  TemporaryDirectory data;
  const std::string key = *MakePrivateKey();
  server::HttpServer moved(
      {.listen_address = "127.0.0.1:0",
       .certificate_file = data.WriteFile("server.crt", *ca->IssueServer(key, {"10.0.0.5"}, Now())),
       .key_file = data.WriteFile("server.key", key)},
      server::IdentityRoutes(&authority(), nullptr, [] { return absl::OkStatus(); }));
  ASSERT_OK_AND_ASSIGN(const int port, moved.Start());
  rigcal::JoinString join = MakeJoin();
  join.https_port = static_cast<uint16_t>(port);
  EXPECT_THAT(rigcal::JoinServer(join, "pc-1"),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("other addresses")));
  EXPECT_THAT(authority().ListIdentities(), SizeIs(0));
}

TEST_F(JoinServer, LetsOneOfTwoWinASecret) {
  StartServer();
  const rigcal::JoinString join = MakeJoin();
  absl::Status results[2];
  std::thread other([&] { results[1] = rigcal::JoinServer(join, "pc-2").status(); });
  results[0] = rigcal::JoinServer(join, "pc-1").status();
  other.join();
  EXPECT_NE(results[0].ok(), results[1].ok()) << results[0] << "\n" << results[1];
  EXPECT_THAT(results[results[0].ok() ? 1 : 0],
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("already used")));
  EXPECT_THAT(authority().ListIdentities(), SizeIs(1));
}

// The agent's clock is a year off, in either direction: joining and renewing work all the same.
TEST_F(JoinServer, WorksWithAClockThatIsAYearOff) {
  for (const absl::Duration ahead : {absl::Hours(24 * 365), -absl::Hours(24 * 365)}) {
    StartServer(ahead);
    const std::string name = ahead > absl::ZeroDuration() ? "pc-late" : "pc-early";
    ASSERT_OK_AND_ASSIGN(const PeerIdentity joined, rigcal::JoinServer(MakeJoin(), name));
    EXPECT_TRUE(IsRenewalDue(joined)) << "as far as it can tell";
    ASSERT_OK_AND_ASSIGN(const auto early, RenewIdentity(joined));
    EXPECT_FALSE(early.has_value()) << "the server knows better";
    PeerIdentity old = joined;
    old.certificate_pem =
        IssuedBefore(folder(), {Role::kAgent, name, PublicKeyOf(joined.certificate_pem)},
                     Now() - absl::Hours(24 * 25));
    ASSERT_OK_AND_ASSIGN(const auto renewed, RenewIdentity(old));
    ASSERT_TRUE(renewed.has_value());
    EXPECT_GT(ParseCertificate(renewed->certificate_pem)->not_after, Now());
    EXPECT_EQ(renewed->key_pem, joined.key_pem);
  }
}

TEST_F(JoinServer, RenewsAfterASleepButNotForever) {
  StartServer();
  ASSERT_OK_AND_ASSIGN(const auto slept, RenewIdentity(JoinedBefore(absl::Hours(24 * 60))));
  EXPECT_TRUE(slept.has_value());
  ASSERT_THAT(authority().Revoke("rigcal://agents/pc-1"), IsOk());
  EXPECT_THAT(RenewIdentity(JoinedBefore(absl::Hours(24 * 200))),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("too long ago")));
}

TEST_F(JoinServer, IsToldOfARevocation) {
  StartServer();
  ASSERT_OK_AND_ASSIGN(const PeerIdentity identity, rigcal::JoinServer(MakeJoin(), "pc-1"));
  ASSERT_THAT(authority().Revoke("rigcal://agents/pc-1"), IsOk());
  EXPECT_THAT(RenewIdentity(identity),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("revoked")));
}

// By the clock of this PC, which is behind, the certificate is good for weeks.
TEST_F(JoinServer, KeepsRenewedByTheServersClock) {
  StartServer(absl::Hours(24 * 35));
  const PeerIdentity old = JoinedBefore(absl::Hours(24 * 35));
  EXPECT_FALSE(IsRenewalDue(old));
  TemporaryDirectory config;
  const IdentityFolder folder = IdentityFolder::OfUser(config.path());
  ASSERT_THAT(folder.Replace(old), IsOk());
  ASSERT_THAT(KeepRenewed(folder), IsOk());
  ASSERT_OK_AND_ASSIGN(const PeerIdentity renewed, folder.Load());
  EXPECT_GT(ParseCertificate(renewed.certificate_pem)->not_after, Now());
  // Asked a moment ago: this would be noticed, since nobody answers any more.
  StopServer();
  EXPECT_THAT(KeepRenewed(folder), IsOk());
}

TEST_F(JoinServer, AsksOnceADayWhatIsDue) {
  StartServer();
  ASSERT_OK_AND_ASSIGN(const PeerIdentity identity, rigcal::JoinServer(MakeJoin(), "pc-1"));
  TemporaryDirectory config;
  const IdentityFolder folder = IdentityFolder::OfUser(config.path());
  ASSERT_THAT(folder.Replace(identity), IsOk());
  EXPECT_THAT(KeepRenewed(folder), IsOk());
  ASSERT_TRUE(folder.Asked().has_value());
  StopServer();
  EXPECT_THAT(KeepRenewed(folder), IsOk());
  // A day ago, and by a clock that was two days ahead.
  for (const int hours : {-25, 48}) {
    std::filesystem::last_write_time(
        folder.path() / "asked",
        std::filesystem::file_time_type::clock::now() + std::chrono::hours(hours));
    EXPECT_THAT(KeepRenewed(folder), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("refused")))
        << hours;
  }
}

TEST_F(JoinServer, SaysWhyAConnectionIsRefused) {
  StartServer();
  PeerIdentity identity = *rigcal::JoinServer(MakeJoin(), "pc-1");
  TemporaryDirectory state;
  const IdentityFolder folder = IdentityFolder::OfAgent(state.path());
  const auto why = [&] {
    EXPECT_THAT(folder.Replace(identity), IsOk());
    return ExplainRefusal(folder, std::chrono::seconds(3));
  };
  EXPECT_THAT(why(), IsOk());
  const PeerIdentity good = identity;
  identity.certificate_pem =
      IssuedBefore(this->folder(), {Role::kAgent, "pc-1", PublicKeyOf(good.certificate_pem)},
                   Now() - absl::Hours(24 * 40));
  EXPECT_THAT(why(), StatusIs(absl::StatusCode::kAborted, HasSubstr("renewed just now")));
  EXPECT_THAT(ExplainRefusal(folder, std::chrono::seconds(3)), IsOk());
  identity = good;
  ASSERT_THAT(authority().Revoke("rigcal://agents/pc-1"), IsOk());
  EXPECT_THAT(why(), StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("revoked")));
  StopServer();
  EXPECT_THAT(why(), IsOk()) << "neither port answers: no reason is known";
}

// The HTTPS port is behind a firewall.
TEST_F(JoinServer, SaysWhatTheHandshakeTellsOfARefusal) {
  StartServer();
  PeerIdentity identity = *rigcal::JoinServer(MakeJoin(), "pc-1");
  StopServer();
  TemporaryDirectory state;
  const IdentityFolder folder = IdentityFolder::OfAgent(state.path());
  const auto ca = server::CertificateAuthority::Open(this->folder());
  const std::string key = *MakePrivateKey();
  const std::string certificate = *ca->IssueServer(key, {"127.0.0.1"}, Now());
  const Impostor other("");
  const OneShotListener refusing(certificate, key, other.ca());
  identity.grpc = {refusing.address()};
  ASSERT_THAT(folder.Replace(identity), IsOk());
  EXPECT_THAT(ExplainRefusal(folder, std::chrono::seconds(3)),
              StatusIs(absl::StatusCode::kPermissionDenied,
                       AllOf(HasSubstr(refusing.address()), HasSubstr("'pc-1'"))));
  TemporaryDirectory elsewhere;
  const auto other_ca = server::CertificateAuthority::Open(elsewhere.path());
  const OneShotListener another(*other_ca->IssueServer(key, {"127.0.0.1"}, Now()), key, ca->pem());
  identity.grpc = {another.address()};
  ASSERT_THAT(folder.Replace(identity), IsOk());
  EXPECT_THAT(ExplainRefusal(folder, std::chrono::seconds(3)),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("another CA")));
}

// Whoever asks too soon is asked for later, and not forgotten.
TEST_F(JoinServer, ARevokedAgentIsToldSoonWheneverItAsks) {
  StartServer();
  ASSERT_OK_AND_ASSIGN(const PeerIdentity identity, rigcal::JoinServer(MakeJoin(), "pc-1"));
  TemporaryDirectory state;
  const IdentityFolder folder = IdentityFolder::OfAgent(state.path());
  ASSERT_THAT(folder.Replace(identity), IsOk());
  std::mutex mutex;
  std::string told;
  const auto keep = [&](const std::string& why) {
    const std::lock_guard lock(mutex);
    told = why;
  };
  RenewalThread thread(folder, {.renewed = [] {}, .trouble = keep}, std::chrono::minutes(10),
                       std::chrono::milliseconds(500));
  thread.Start();
  // The first question, at the start, has been answered well.
  ASSERT_TRUE(WaitFor([&] { return folder.Asked().has_value(); }));
  ASSERT_THAT(authority().Revoke("rigcal://agents/pc-1"), IsOk());
  thread.AskSoon();
  EXPECT_TRUE(WaitFor(
      [&] {
        const std::lock_guard lock(mutex);
        return told.find("was revoked") != std::string::npos;
      },
      std::chrono::seconds(60)));
}

TEST_F(JoinServer, IsRenewedByTheThread) {
  StartServer();
  const PeerIdentity old = JoinedBefore(absl::Hours(24 * 25));
  TemporaryDirectory state;
  const IdentityFolder folder = IdentityFolder::OfAgent(state.path());
  ASSERT_THAT(folder.Replace(old), IsOk());
  std::atomic<int> renewals = 0, troubles = 0;
  {
    RenewalThread thread(
        folder,
        {.renewed = [&] { ++renewals; }, .trouble = [&](const std::string&) { ++troubles; }},
        std::chrono::milliseconds(10));
    thread.Start();
    EXPECT_TRUE(WaitFor([&] { return renewals > 0; }));
    ASSERT_OK_AND_ASSIGN(const PeerIdentity renewed, folder.Load());
    EXPECT_NE(renewed.certificate_pem, old.certificate_pem);
    StopServer();
    ASSERT_THAT(folder.Renew(old), IsOk());
    EXPECT_TRUE(WaitFor([&] { return troubles > 0; }));
  }
  ASSERT_OK_AND_ASSIGN(const PeerIdentity kept, folder.Load());
  EXPECT_EQ(kept, old) << "what cannot be renewed stays";
}

TEST(RenewalThread, SurvivesWhatItsEventsThrow) {
  TemporaryDirectory state;  // nothing in it, which is trouble
  std::atomic<int> calls = 0;
  RenewalThread thread(IdentityFolder::OfAgent(state.path()),
                       {.renewed = [] {},
                        .trouble =
                            [&](const std::string&) {
                              if (++calls < 4) throw std::bad_alloc();
                            }},
                       std::chrono::milliseconds(1));
  thread.Start();
  EXPECT_TRUE(WaitFor([&] { return calls >= 4; }));
}

}  // namespace
}  // namespace rigcal::testing::join_server_test
