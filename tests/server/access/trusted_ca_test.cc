// SPDX-License-Identifier: Apache-2.0
#include "server/access/trusted_ca.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/time/clock.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::trusted_ca_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class TrustedCa : public ::testing::Test {
 protected:
  TrustedCa() : trusted_(*server::TrustedCa::Parse(ca_.certificate_pem())) {}

  absl::StatusOr<server::Peer> Identify(const CertificateWish& wish) {
    return trusted_.Identify(ca_.Make(wish).certificate_pem, now_);
  }

  const absl::Time now_ = absl::Now();
  TestCa ca_;
  server::TrustedCa trusted_;
};

TEST_F(TrustedCa, SaysWhoAndWhichRole) {
  const TestCertificate agent = ca_.MakeAgent("pc-1");
  ASSERT_OK_AND_ASSIGN(const server::Peer peer, trusted_.Identify(agent.certificate_pem, now_));
  EXPECT_TRUE(peer.IsAgent());
  EXPECT_EQ(peer.name, "pc-1");
  EXPECT_EQ(peer.uri, "rigcal://agents/pc-1");
  EXPECT_EQ(peer.serial, agent.serial);
  EXPECT_GT(peer.not_after_utc_s, absl::ToUnixSeconds(now_ + absl::Hours(29 * 24)));
  for (const auto& [word, role] : {std::pair{"operator", Role::kOperator},
                                   {"viewer", Role::kViewer},
                                   {"admin", Role::kAdmin}}) {
    ASSERT_OK_AND_ASSIGN(const server::Peer user,
                         trusted_.Identify(ca_.MakeUser("kim", word).certificate_pem, now_));
    EXPECT_EQ(user.role, role);
    EXPECT_FALSE(user.IsAgent());
  }
}

TEST_F(TrustedCa, ACertificateOfAnotherCaOrSelfSignedIsRefused) {
  const TestCa other;
  EXPECT_THAT(trusted_.Identify(other.MakeAgent("pc1").certificate_pem, now_),
              StatusIs(absl::StatusCode::kUnauthenticated,
                       AllOf(HasSubstr("'pc1'"), HasSubstr("another CA"))));
  EXPECT_THAT(Identify({.self_signed = true}),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("pc1")));
}

TEST_F(TrustedCa, ACertificateOutsideItsTimeIsRefused) {
  EXPECT_THAT(Identify({.begins_in_s = -7200, .ends_in_s = -60}),
              StatusIs(absl::StatusCode::kUnauthenticated,
                       AllOf(HasSubstr("expired"), HasSubstr("renew"))));
  EXPECT_THAT(Identify({.begins_in_s = 3600}),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("clocks")));
  const TestCertificate good = ca_.MakeAgent("pc1");
  EXPECT_THAT(trusted_.Identify(good.certificate_pem, now_), IsOk());
  EXPECT_THAT(trusted_.Identify(good.certificate_pem, now_ + absl::Hours(366 * 24)),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("expired")));
}

TEST_F(TrustedCa, ACertificateOfAnotherFormIsRefused) {
  const CertificateWish wrong[] = {
      {.uris = {}},
      {.uris = {"rigcal://agents/pc1", "rigcal://agents/pc2"}},
      {.uris = {"https://pc1"}},
      {.uris = {"rigcal://server"}},
      {.uris = {"rigcal://agents/"}},
      {.uris = {"rigcal://agents/..%2fpc1"}},
      {.role = ""},
      {.role = "root"},
      {.role = "admin"},  // with an agent's URI
      {.role = "agent", .uris = {"rigcal://users/pc1"}},
  };
  for (const CertificateWish& wish : wrong) {
    EXPECT_THAT(Identify(wish), StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("")))
        << wish.role << " " << (wish.uris.empty() ? "no URI" : wish.uris[0]);
  }
  EXPECT_THAT(trusted_.Identify("no certificate", now_),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("read")));
  // A server's own certificate must not open its doors.
  EXPECT_THAT(trusted_.Identify(ca_.MakeServer().certificate_pem, now_),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("purpose")));
}

TEST_F(TrustedCa, NamesInMessagesAreEscaped) {
  EXPECT_THAT(Identify({.common_name = "a\nb\x1b[2J", .role = "x\ny"}),
              StatusIs(absl::StatusCode::kUnauthenticated,
                       AllOf(HasSubstr("a\\nb"), ::testing::Not(HasSubstr("\n")),
                             ::testing::Not(HasSubstr("\x1b")))));
}

TEST_F(TrustedCa, ACertificateOfTheServerMustMatchItsKeyAndTheCa) {
  const TestCertificate good = ca_.MakeServer();
  const TestCertificate another = ca_.MakeServer();
  EXPECT_THAT(trusted_.CheckServerCertificate(good.certificate_pem, good.key_pem, now_), IsOk());
  EXPECT_THAT(trusted_.CheckServerCertificate(good.certificate_pem, another.key_pem, now_),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("private key")));
  const TestCa other;
  const TestCertificate foreign = other.MakeServer();
  EXPECT_THAT(trusted_.CheckServerCertificate(foreign.certificate_pem, foreign.key_pem, now_),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("another CA")));
  EXPECT_THAT(trusted_.CheckServerCertificate("", good.key_pem, now_),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("certificate")));
  EXPECT_THAT(trusted_.CheckServerCertificate(good.certificate_pem, "x", now_),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("key")));
  const TestCertificate agent = ca_.MakeAgent("pc1");
  EXPECT_THAT(trusted_.CheckServerCertificate(agent.certificate_pem, agent.key_pem, now_),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("purpose")));
}

TEST_F(TrustedCa, OnlyACaIsTrusted) {
  EXPECT_THAT(server::TrustedCa::Parse(""),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no certificate")));
  EXPECT_THAT(server::TrustedCa::Parse(ca_.MakeAgent("pc1").certificate_pem),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no CA")));
}

TEST_F(TrustedCa, MayBeSeveral) {
  const TestCa other;
  const auto both = server::TrustedCa::Parse(ca_.certificate_pem() + other.certificate_pem());
  ASSERT_THAT(both, IsOk());
  EXPECT_THAT(both->Identify(ca_.MakeAgent("pc1").certificate_pem, now_), IsOk());
  EXPECT_THAT(both->Identify(other.MakeAgent("pc2").certificate_pem, now_), IsOk());
  EXPECT_THAT(both->Identify(TestCa().MakeAgent("pc3").certificate_pem, now_),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("another CA")));
}

}  // namespace
}  // namespace rigcal::testing::trusted_ca_test
