// SPDX-License-Identifier: Apache-2.0
#include "common/enrolment/join_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/escaping.h"
#include "common/enrolment/renewal_thread.h"
#include "common/identity/certificate_request.h"
#include "common/identity/durable_file.h"
#include "common/identity/private_key.h"
#include "server/http/identity_routes.h"
#include "server/identity/server_identity.h"
#include "tests/server/http/join_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::join_server_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class JoinServer : public JoinFixture {
 protected:
  // Of an agent that joined so long ago, by its own clock and the server's.
  PeerIdentity JoinedBefore(absl::Duration ago) {
    PeerIdentity identity = *rigcal::JoinServer(MakeJoin(), "pc-1");
    const auto ca = server::CertificateAuthority::Open(folder());
    identity.certificate_pem =
        *ca->IssuePeer({Role::kAgent, "pc-1", PublicKeyOf(identity.certificate_pem)}, Now() - ago);
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
    const auto ca = server::CertificateAuthority::Open(folder());
    old.certificate_pem = *ca->IssuePeer({Role::kAgent, name, PublicKeyOf(joined.certificate_pem)},
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

}  // namespace
}  // namespace rigcal::testing::join_server_test
