// SPDX-License-Identifier: Apache-2.0
#include "server/identity/identity_authority.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/file/durable_file.h"
#include "common/identity/certificate_request.h"
#include "common/identity/join_string.h"
#include "common/identity/private_key.h"
#include "server/identity/accepted_certificates.h"
#include "server/identity/denied_certificates.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::identity_authority_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

class IdentityAuthority : public ::testing::Test {
 protected:
  IdentityAuthority() { Open(); }

  void Open() {
    auto opened = server::IdentityAuthority::Open(folder(), [this] { return now_; });
    ASSERT_THAT(opened, IsOk());
    authority_ = *std::move(opened);
    authority_->SetAddresses({.hosts = {"10.0.0.5"}, .grpc_port = 7420, .https_port = 7421});
  }
  std::filesystem::path folder() const { return data_.path() / "identity"; }
  std::string SecretFor(Role role = Role::kAgent, const std::string& name = "",
                        absl::Duration ttl = absl::Hours(1)) {
    const auto made = authority_->CreateToken(role, ttl, name);
    EXPECT_THAT(made, IsOk());
    return ParseJoinString(made->join_string)->secret;
  }
  static std::string Request(const std::string& key, const std::string& name,
                             Role role = Role::kAgent) {
    return *MakeCertificateRequest(key, name, role);
  }
  absl::StatusOr<std::string> Join(const std::string& name, const std::string& key) {
    const auto issued = authority_->Enrol(SecretFor(), Request(key, name));
    if (!issued.ok()) return issued.status();
    return issued->certificate_pem;
  }
  bool Denied(const std::string& pem) const {
    const auto certificate = ParseCertificate(pem);
    return *server::DeniedCertificates(folder() / "denied.json")
                .Denies(certificate->uri, certificate->serial);
  }

  absl::Time now_ = absl::FromUnixSeconds(1'795'000'000);
  const std::string key_ = *MakePrivateKey();
  TemporaryDirectory data_;
  std::unique_ptr<server::IdentityAuthority> authority_;
};

TEST_F(IdentityAuthority, GivesACertificateForASecret) {
  const auto issued = authority_->Enrol(SecretFor(), Request(key_, "pc-1"));
  ASSERT_THAT(issued, IsOk());
  ASSERT_OK_AND_ASSIGN(const Certificate certificate, ParseCertificate(issued->certificate_pem));
  EXPECT_EQ(certificate.name, "pc-1");
  EXPECT_EQ(certificate.role, Role::kAgent);
  EXPECT_EQ(certificate.uri, "rigcal://agents/pc-1");
  EXPECT_EQ(certificate.not_after, now_ + absl::Hours(24 * 30));
  EXPECT_THAT(CheckKeyOf(issued->certificate_pem, key_, ""), IsOk());
  EXPECT_THAT(CheckIssuedBy(certificate, issued->ca_pem, CertificateUse::kClient), IsOk());
  EXPECT_THAT(CheckIssuedBy(certificate, issued->ca_pem, CertificateUse::kServer), Not(IsOk()))
      << "an agent must not be able to play the server";
  EXPECT_THAT(issued->grpc, ElementsAre("10.0.0.5:7420"));
  EXPECT_THAT(issued->https, ElementsAre("10.0.0.5:7421"));
}

TEST_F(IdentityAuthority, KeepsNoSecret) {
  const auto made = authority_->CreateToken(Role::kAgent, absl::Hours(1), "");
  ASSERT_THAT(made, IsOk());
  ASSERT_OK_AND_ASSIGN(const std::string file, ReadSmallFile(folder() / "tokens.json"));
  const std::string secret = ParseJoinString(made->join_string)->secret;
  EXPECT_THAT(file, Not(HasSubstr(secret)));
  EXPECT_THAT(file, HasSubstr(made->token.id));
}

TEST_F(IdentityAuthority, TakesASecretOnce) {
  const std::string secret = SecretFor();
  ASSERT_THAT(authority_->Enrol(secret, Request(key_, "pc-1")), IsOk());
  EXPECT_THAT(authority_->Enrol(secret, Request(*MakePrivateKey(), "pc-2")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("already used")));
  Open();
  EXPECT_THAT(authority_->Enrol(secret, Request(*MakePrivateKey(), "pc-2")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("rigcal://agents/pc-1")))
      << "after a restart as well";
  EXPECT_THAT(authority_->Enrol(secret, Request(key_, "pc-1")), IsOk())
      << "who lost the answer may ask again, with the same key";
  EXPECT_THAT(authority_->Enrol(secret, Request(key_, "pc-3")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("already used")));
}

TEST_F(IdentityAuthority, LetsOneOfManyWinASecret) {
  const std::string secret = SecretFor();
  std::vector<std::thread> threads;
  std::atomic<int> joined = 0, refused = 0;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&, i] {
      const auto issued =
          authority_->Enrol(secret, Request(*MakePrivateKey(), "pc-" + std::to_string(i)));
      (issued.ok() ? joined : refused) += 1;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(joined, 1);
  EXPECT_EQ(refused, 7);
  EXPECT_THAT(authority_->ListIdentities(), SizeIs(1));
}

TEST_F(IdentityAuthority, RefusesExpiredRevokedAndUnknownSecrets) {
  const std::string expired = SecretFor(Role::kAgent, "", absl::Minutes(10));
  now_ += absl::Minutes(10);
  EXPECT_THAT(authority_->Enrol(expired, Request(key_, "pc-1")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("expired at 2026-")));
  const auto made = authority_->CreateToken(Role::kAgent, absl::Hours(1), "");
  ASSERT_THAT(authority_->RevokeToken(made->token.id), IsOk());
  EXPECT_THAT(authority_->Enrol(ParseJoinString(made->join_string)->secret, Request(key_, "pc-1")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("was revoked")));
  for (const std::string& secret : {std::string(), std::string(16, 'x'), std::string(5000, 'x')}) {
    EXPECT_THAT(authority_->Enrol(secret, Request(key_, "pc-1")),
                StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("another server")));
  }
  EXPECT_THAT(authority_->RevokeToken("t-nobody"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("t-nobody")));
}

TEST_F(IdentityAuthority, RefusesAnotherRoleOrNameAndKeepsTheSecretUsable) {
  const std::string secret = SecretFor(Role::kViewer, "anna");
  EXPECT_THAT(authority_->Enrol(secret, Request(key_, "anna", Role::kOperator)),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("role viewer")));
  EXPECT_THAT(authority_->Enrol(secret, Request(key_, "anna", Role::kAdmin)),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("admin")));
  EXPECT_THAT(authority_->Enrol(secret, Request(key_, "bob", Role::kViewer)),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("anna")));
  EXPECT_THAT(authority_->Enrol(SecretFor(), Request(key_, "no name")),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("name")));
  EXPECT_THAT(authority_->Enrol(secret, "no request"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("PEM")));
  const auto issued = authority_->Enrol(secret, Request(key_, "anna", Role::kViewer));
  ASSERT_THAT(issued, IsOk());
  EXPECT_EQ(ParseCertificate(issued->certificate_pem)->uri, "rigcal://users/anna");
}

TEST_F(IdentityAuthority, MakesNoTokenForAdminsOrWithoutEnd) {
  EXPECT_THAT(authority_->CreateToken(Role::kAdmin, absl::Hours(1), ""),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("admin")));
  for (const absl::Duration ttl :
       {absl::ZeroDuration(), -absl::Hours(1), absl::Hours(24 * 31), absl::InfiniteDuration()}) {
    EXPECT_THAT(authority_->CreateToken(Role::kAgent, ttl, ""),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("life")));
  }
  EXPECT_THAT(authority_->CreateToken(Role::kAgent, absl::Hours(1), "no name"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("name")));
}

// A secret for any agent must not let its holder take over the cameras of one that is there.
TEST_F(IdentityAuthority, GivesANameTwiceOnlyWhereThatIsMeant) {
  ASSERT_OK_AND_ASSIGN(const std::string first, Join("pc-1", key_));
  EXPECT_THAT(Join("pc-1", *MakePrivateKey()),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("--name pc-1")));
  EXPECT_FALSE(Denied(first));
  const std::string secret = SecretFor(Role::kAgent, "pc-1");
  const auto replaced = authority_->Enrol(secret, Request(*MakePrivateKey(), "pc-1"));
  ASSERT_THAT(replaced, IsOk());
  EXPECT_TRUE(Denied(first));
  EXPECT_FALSE(Denied(replaced->certificate_pem));
  EXPECT_THAT(authority_->Renew(first, Request(key_, "pc-1")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("revoked")));
}

// An agent on the server's PC needs no certificate to have a name, and cameras.
TEST_F(IdentityAuthority, GivesNobodyTheNameOfAnAgentWithoutCertificate) {
  std::string asked;
  authority_->SetNameHolder([&](const std::string& name) {
    asked += name + " ";
    return std::string(name == "pc-1" ? "on host 'lab', with camera rig/left" : "");
  });
  const std::string secret = SecretFor();
  EXPECT_THAT(
      authority_->Enrol(secret, Request(key_, "pc-1")),
      StatusIs(absl::StatusCode::kAlreadyExists,
               AllOf(HasSubstr("rig/left"), HasSubstr("token create --role agent --name pc-1"),
                     HasSubstr("rigcal agent forget pc-1"))));
  EXPECT_THAT(authority_->ListIdentities(), SizeIs(0));
  ASSERT_THAT(authority_->Enrol(secret, Request(key_, "pc-2")), IsOk()) << "still unused";
  EXPECT_THAT(authority_->Enrol(SecretFor(Role::kAgent, "pc-1"), Request(key_, "pc-1")), IsOk())
      << "an operator has made a string for the name";
  EXPECT_THAT(authority_->Enrol(SecretFor(Role::kOperator), Request(key_, "pc-1", Role::kOperator)),
              IsOk())
      << "users are no agents";
  EXPECT_EQ(asked, "pc-1 pc-2 ");
  // A certificate that is refused does not free its cameras; forgetting the agent does both.
  ASSERT_THAT(authority_->Revoke("rigcal://agents/pc-1"), IsOk());
  EXPECT_THAT(authority_->Enrol(SecretFor(), Request(key_, "pc-1")),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("rig/left")));
  authority_->SetNameHolder([](const std::string&) { return std::string(); });
  EXPECT_THAT(authority_->Enrol(SecretFor(), Request(key_, "pc-1")), IsOk());
}

TEST_F(IdentityAuthority, RevokesAtOnceAndLetsTheNameJoinAgain) {
  ASSERT_OK_AND_ASSIGN(const std::string first, Join("pc-1", key_));
  ASSERT_THAT(authority_->Revoke("rigcal://agents/pc-1"), IsOk());
  EXPECT_TRUE(Denied(first));
  EXPECT_THAT(authority_->Renew(first, Request(key_, "pc-1")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("revoked")));
  EXPECT_TRUE(authority_->ListIdentities()[0].revoked.has_value());
  Open();
  EXPECT_TRUE(authority_->ListIdentities()[0].revoked.has_value());
  ASSERT_OK_AND_ASSIGN(const std::string second, Join("pc-1", *MakePrivateKey()));
  EXPECT_FALSE(Denied(second));
  EXPECT_TRUE(Denied(first));
}

// Somebody who joined after the backup that was restored.
TEST_F(IdentityAuthority, RevokesANameThatIsNotOnRecord) {
  ASSERT_OK_AND_ASSIGN(const std::string ghost, Join("pc-1", key_));
  ASSERT_OK_AND_ASSIGN(const std::string record, ReadSmallFile(folder() / "identities.json"));
  authority_.reset();
  std::filesystem::remove(folder() / "identities.json");
  Open();
  EXPECT_FALSE(Denied(ghost));
  EXPECT_THAT(authority_->Renew(ghost, Request(key_, "pc-1")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("not on record")));
  ASSERT_THAT(authority_->Revoke("rigcal://agents/pc-1"), IsOk());
  EXPECT_TRUE(Denied(ghost));
  ASSERT_OK_AND_ASSIGN(const std::string again, Join("pc-1", *MakePrivateKey()));
  EXPECT_FALSE(Denied(again));
  EXPECT_TRUE(Denied(ghost));
  // A backup that knows him does not bring him back.
  authority_.reset();
  ReplaceTestFile(folder() / "identities.json", record);
  Open();
  EXPECT_THAT(authority_->Renew(ghost, Request(key_, "pc-1")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("revoked")));
  for (const char* uri :
       {"", "pc-1", "rigcal://agents/", "rigcal://agents/no name", "rigcal://server"}) {
    EXPECT_THAT(authority_->Revoke(uri),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("URI")));
  }
}

TEST_F(IdentityAuthority, ATokenTakesWhoJoinedByItThoughHeIsNotOnRecord) {
  const auto made = authority_->CreateToken(Role::kAgent, absl::Hours(1), "");
  const std::string secret = ParseJoinString(made->join_string)->secret;
  const auto issued = authority_->Enrol(secret, Request(key_, "pc-1"));
  ASSERT_THAT(issued, IsOk());
  authority_.reset();
  std::filesystem::remove(folder() / "identities.json");
  Open();
  ASSERT_THAT(authority_->RevokeToken(made->token.id), IsOk());
  EXPECT_TRUE(Denied(issued->certificate_pem));
}

TEST_F(IdentityAuthority, AnOldCertificateStaysValidWhenItIsRenewed) {
  ASSERT_OK_AND_ASSIGN(const std::string first, Join("pc-1", key_));
  now_ += absl::Hours(24 * 20);
  const auto renewed = authority_->Renew(first, Request(key_, "pc-1"));
  ASSERT_THAT(renewed, IsOk());
  server::AcceptedCertificates accepted(folder());
  for (const std::string& pem : {first, renewed->certificate_pem}) {
    ASSERT_OK_AND_ASSIGN(const Certificate certificate, ParseCertificate(pem));
    EXPECT_EQ(*accepted.Find(certificate.uri, certificate.serial),
              server::AcceptedCertificates::Standing::kAccepted);
  }
}

TEST_F(IdentityAuthority, DoesNotTakeBackARevocationForAUsedSecret) {
  const std::string secret = SecretFor();
  ASSERT_THAT(authority_->Enrol(secret, Request(key_, "pc-1")), IsOk());
  ASSERT_THAT(authority_->Revoke("rigcal://agents/pc-1"), IsOk());
  EXPECT_THAT(authority_->Enrol(secret, Request(key_, "pc-1")),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("already used")));
}

TEST_F(IdentityAuthority, RevokesWhoJoinedWithAToken) {
  const auto made = authority_->CreateToken(Role::kOperator, absl::Hours(1), "");
  const std::string secret = ParseJoinString(made->join_string)->secret;
  const auto issued = authority_->Enrol(secret, Request(key_, "anna", Role::kOperator));
  ASSERT_THAT(issued, IsOk());
  Open();
  ASSERT_THAT(authority_->RevokeToken(made->token.id), IsOk());
  EXPECT_TRUE(Denied(issued->certificate_pem));
}

TEST_F(IdentityAuthority, RenewsAtTwoThirdsOfTheLife) {
  ASSERT_OK_AND_ASSIGN(const std::string first, Join("pc-1", key_));
  now_ += absl::Hours(24 * 19);
  const auto early = authority_->Renew(first, Request(key_, "pc-1"));
  ASSERT_THAT(early, IsOk());
  EXPECT_EQ(early->certificate_pem, first);
  now_ += absl::Hours(24);
  const auto due = authority_->Renew(first, Request(key_, "pc-1"));
  ASSERT_THAT(due, IsOk());
  EXPECT_NE(due->certificate_pem, first);
  EXPECT_EQ(ParseCertificate(due->certificate_pem)->not_after, now_ + absl::Hours(24 * 30));
  ASSERT_THAT(authority_->Revoke("rigcal://agents/pc-1"), IsOk());
  EXPECT_TRUE(Denied(first)) << "every certificate of the name";
  EXPECT_TRUE(Denied(due->certificate_pem));
}

TEST_F(IdentityAuthority, RenewsAfterTheEndForAWhile) {
  ASSERT_OK_AND_ASSIGN(const std::string first, Join("pc-1", key_));
  now_ += absl::Hours(24 * 30) + server::kRenewalGrace;
  EXPECT_THAT(authority_->Renew(first, Request(key_, "pc-1")), IsOk());
  now_ += absl::Hours(1);
  EXPECT_THAT(authority_->Renew(first, Request(key_, "pc-1")),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("too long ago")));
}

// The server's clock was a year ahead when the certificate was made.
TEST_F(IdentityAuthority, RenewsACertificateOfTheFuture) {
  ASSERT_OK_AND_ASSIGN(const std::string first, Join("pc-1", key_));
  now_ -= absl::Hours(24 * 365);
  const auto renewed = authority_->Renew(first, Request(key_, "pc-1"));
  ASSERT_THAT(renewed, IsOk());
  EXPECT_LT(ParseCertificate(renewed->certificate_pem)->not_before, now_);
}

TEST_F(IdentityAuthority, RenewsForTheHolderOfTheKeyOnly) {
  ASSERT_OK_AND_ASSIGN(const std::string first, Join("pc-1", key_));
  now_ += absl::Hours(24 * 25);
  const std::string request = Request(key_, "pc-1");
  for (const std::string& wrong :
       {Request(*MakePrivateKey(), "pc-1"), Request(key_, "pc-2"),
        Request(key_, "pc-1", Role::kAdmin), std::string("no request")}) {
    EXPECT_THAT(authority_->Renew(first, wrong),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("request")));
  }
  TemporaryDirectory other_data;
  auto other = server::IdentityAuthority::Open(other_data.path(), [this] { return now_; });
  ASSERT_THAT(other, IsOk());
  EXPECT_THAT((*other)->Renew(first, request),
              StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("another CA has signed it")));
  EXPECT_THAT(authority_->Renew(authority_->ca_pem(), request), Not(IsOk()));
  EXPECT_THAT(authority_->Renew("no certificate", request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("PEM")));
}

TEST_F(IdentityAuthority, DoesNotStartWithDamagedFiles) {
  SecretFor();
  ASSERT_THAT(Join("pc-1", key_), IsOk());
  ASSERT_THAT(authority_->Revoke("rigcal://agents/pc-1"), IsOk());
  authority_.reset();
  for (const char* name : {"tokens.json", "identities.json", "denied.json"}) {
    ASSERT_OK_AND_ASSIGN(const std::string good, ReadSmallFile(folder() / name));
    for (const std::string& bad : {std::string(), good.substr(0, good.size() / 2),
                                   std::string("[]"), std::string("{\"tokens\": [3]}")}) {
      std::ofstream(folder() / name, std::ios::trunc) << bad;
      EXPECT_THAT(server::IdentityAuthority::Open(folder(), [this] { return now_; }),
                  StatusIs(absl::StatusCode::kDataLoss, HasSubstr(name)));
    }
    std::ofstream(folder() / name, std::ios::trunc) << good;
  }
  Open();
}

}  // namespace
}  // namespace rigcal::testing::identity_authority_test
