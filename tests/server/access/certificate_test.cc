// SPDX-License-Identifier: Apache-2.0
#include "server/access/certificate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ctime>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::certificate_test {
namespace {

using server::Role;
using server::TrustedCa;
using ::testing::AllOf;
using ::testing::HasSubstr;

class Certificate : public ::testing::Test {
 protected:
  Certificate() : trusted_(*TrustedCa::Parse(ca_.certificate_pem())) {}

  absl::StatusOr<server::Peer> Identify(const CertificateWish& wish) {
    return trusted_.Identify(ca_.Make(wish).certificate_pem, now_);
  }

  const int64_t now_ = std::time(nullptr);
  TestCa ca_;
  TrustedCa trusted_;
};

TEST_F(Certificate, SaysWhoAndWhichRole) {
  const TestCertificate agent = ca_.MakeAgent("pc-1");
  ASSERT_OK_AND_ASSIGN(const server::Peer peer, trusted_.Identify(agent.certificate_pem, now_));
  EXPECT_TRUE(peer.IsAgent());
  EXPECT_EQ(peer.name, "pc-1");
  EXPECT_EQ(peer.uri, "rigcal://agents/pc-1");
  EXPECT_EQ(peer.serial, agent.serial);
  EXPECT_GT(peer.not_after_utc_s, now_ + 29 * 86'400);
  for (const auto& [word, role] : {std::pair{"operator", Role::kOperator},
                                   {"viewer", Role::kViewer},
                                   {"admin", Role::kAdmin}}) {
    ASSERT_OK_AND_ASSIGN(const server::Peer user,
                         trusted_.Identify(ca_.MakeUser("kim", word).certificate_pem, now_));
    EXPECT_EQ(user.role, role);
    EXPECT_FALSE(user.IsAgent());
  }
}

TEST_F(Certificate, OfAnotherCaOrSelfSignedIsRefused) {
  const TestCa other;
  EXPECT_THAT(trusted_.Identify(other.MakeAgent("pc1").certificate_pem, now_),
              StatusIs(absl::StatusCode::kUnauthenticated,
                       AllOf(HasSubstr("'pc1'"), HasSubstr("another CA"))));
  EXPECT_THAT(Identify({.self_signed = true}),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("pc1")));
}

TEST_F(Certificate, OutsideItsTimeIsRefused) {
  EXPECT_THAT(Identify({.begins_in_s = -7200, .ends_in_s = -60}),
              StatusIs(absl::StatusCode::kUnauthenticated,
                       AllOf(HasSubstr("expired"), HasSubstr("renew"))));
  EXPECT_THAT(Identify({.begins_in_s = 3600}),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("clocks")));
  const TestCertificate good = ca_.MakeAgent("pc1");
  EXPECT_THAT(trusted_.Identify(good.certificate_pem, now_), IsOk());
  EXPECT_THAT(trusted_.Identify(good.certificate_pem, now_ + 366 * 86'400),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("expired")));
}

TEST_F(Certificate, OfAnotherFormIsRefused) {
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

TEST_F(Certificate, NamesInMessagesAreEscaped) {
  EXPECT_THAT(Identify({.common_name = "a\nb\x1b[2J", .role = "x\ny"}),
              StatusIs(absl::StatusCode::kUnauthenticated,
                       AllOf(HasSubstr("a\\nb"), ::testing::Not(HasSubstr("\n")),
                             ::testing::Not(HasSubstr("\x1b")))));
}

TEST_F(Certificate, OfTheServerMustMatchItsKeyAndTheCa) {
  const TestCertificate good = ca_.MakeServer();
  const TestCertificate another = ca_.MakeServer();
  EXPECT_THAT(trusted_.CheckServerCertificate(good.certificate_pem, good.key_pem, now_), IsOk());
  EXPECT_THAT(trusted_.CheckServerCertificate(good.certificate_pem, another.key_pem, now_),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("private key")));
  const TestCa other;
  const TestCertificate foreign = other.MakeServer();
  EXPECT_THAT(trusted_.CheckServerCertificate(foreign.certificate_pem, foreign.key_pem, now_),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("another CA")));
  EXPECT_THAT(trusted_.CheckServerCertificate("", good.key_pem, now_),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("certificate")));
  EXPECT_THAT(trusted_.CheckServerCertificate(good.certificate_pem, "x", now_),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("key")));
  const TestCertificate agent = ca_.MakeAgent("pc1");
  EXPECT_THAT(trusted_.CheckServerCertificate(agent.certificate_pem, agent.key_pem, now_),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("purpose")));
}

TEST_F(Certificate, OnlyACaIsTrusted) {
  EXPECT_THAT(TrustedCa::Parse(""), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("")));
  EXPECT_THAT(TrustedCa::Parse(ca_.MakeAgent("pc1").certificate_pem),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no CA")));
}

}  // namespace
}  // namespace rigcal::testing::certificate_test
