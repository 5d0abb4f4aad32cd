// SPDX-License-Identifier: Apache-2.0
#include "common/enrolment/tls_probe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <string>

#include "common/enrolment/join_server.h"
#include "common/identity/certificate_request.h"
#include "common/identity/private_key.h"
#include "server/identity/certificate_authority.h"
#include "tests/server/http/join_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::tls_probe_test {
namespace {

using ::testing::Contains;

constexpr std::chrono::milliseconds kTimeout{1000};

class TlsProbe : public JoinFixture {
 protected:
  void JoinAsUser(absl::Duration server_ahead = absl::ZeroDuration()) {
    StartServer(server_ahead);
    identity_ = *JoinServer(MakeJoin(Role::kOperator, "anna"), "anna");
  }
  // As every program does.
  static void SetUpTestSuite() { signal(SIGPIPE, SIG_IGN); }

  rigcal::TlsProbe Probe(const std::string& to) { return ProbeTls(to, &identity_, kTimeout); }

  PeerIdentity identity_;
};

TEST_F(TlsProbe, FindsNothingWrong) {
  JoinAsUser();
  const rigcal::TlsProbe probe = Probe(address());
  EXPECT_EQ(probe.fault, TlsFault::kNone) << probe.detail;
  ASSERT_TRUE(probe.server.has_value());
  EXPECT_THAT(probe.server->hosts, Contains("127.0.0.1"));
  EXPECT_EQ(ProbeTls(address(), nullptr, kTimeout).fault, TlsFault::kNone);
}

TEST_F(TlsProbe, TellsPortsApart) {
  JoinAsUser();
  const int closed = port();
  StopServer();
  EXPECT_EQ(Probe("127.0.0.1:" + std::to_string(closed)).fault, TlsFault::kPortClosed);
  EXPECT_EQ(Probe("nowhere.invalid:7420").fault, TlsFault::kUnknownHost);
  EXPECT_EQ(Probe("no port").fault, TlsFault::kUnknownHost);
}

TEST_F(TlsProbe, KnowsAnotherCa) {
  JoinAsUser();
  TemporaryDirectory other;
  identity_.ca_pem = server::CertificateAuthority::Open(other.path())->pem();
  EXPECT_EQ(Probe(address()).fault, TlsFault::kOtherCa);
}

TEST_F(TlsProbe, KnowsAnotherName) {
  JoinAsUser();
  const auto ca = server::CertificateAuthority::Open(folder());
  const std::string key = *MakePrivateKey();
  const OneShotListener moved(*ca->IssueServer(key, {"10.0.0.5", "rig.lab"}, Now()), key,
                              ca->pem());
  const rigcal::TlsProbe probe = Probe(moved.address());
  EXPECT_EQ(probe.fault, TlsFault::kWrongName) << probe.detail;
  EXPECT_THAT(probe.server->hosts, Contains("rig.lab"));
}

TEST_F(TlsProbe, KnowsAServerWithoutTls) {
  JoinAsUser();
  const OneShotListener http("HTTP/1.1 400 Bad Request\r\n\r\n");
  EXPECT_EQ(Probe(http.address()).fault, TlsFault::kPlaintext);
  // The first frame of an HTTP/2 server.
  const OneShotListener grpc(std::string("\0\0\x06\x04\0\0\0\0\0\0\x04\0\0\xff\xff", 15));
  EXPECT_EQ(Probe(grpc.address()).fault, TlsFault::kPlaintext);
}

TEST_F(TlsProbe, KnowsWhenItsOwnCertificateIsRefused) {
  JoinAsUser();
  const auto ca = server::CertificateAuthority::Open(folder());
  const std::string key = *MakePrivateKey();
  const std::string certificate = *ca->IssueServer(key, {"127.0.0.1"}, Now());
  const OneShotListener good(certificate, key, ca->pem());
  EXPECT_EQ(Probe(good.address()).fault, TlsFault::kNone);
  EXPECT_EQ(ProbeTls(good.address(), nullptr, kTimeout).fault, TlsFault::kClientRefused);
  TemporaryDirectory other;
  const OneShotListener strict(certificate, key,
                               server::CertificateAuthority::Open(other.path())->pem());
  EXPECT_EQ(Probe(strict.address()).fault, TlsFault::kClientRefused);
  PeerIdentity expired = identity_;
  expired.certificate_pem =
      *ca->IssuePeer({Role::kOperator, "anna", PublicKeyOf(identity_.certificate_pem)},
                     Now() - absl::Hours(24 * 60));
  EXPECT_EQ(ProbeTls(good.address(), &expired, kTimeout).fault, TlsFault::kClientRefused);
}

TEST_F(TlsProbe, KnowsAClockThatIsFarOff) {
  JoinAsUser(absl::Hours(24 * 365 * 3));
  EXPECT_EQ(Probe(address()).fault, TlsFault::kNotYetValid);
  JoinAsUser(-absl::Hours(24 * 365 * 3));
  EXPECT_EQ(Probe(address()).fault, TlsFault::kExpired);
}

}  // namespace
}  // namespace rigcal::testing::tls_probe_test
