// SPDX-License-Identifier: Apache-2.0
// T17: a backup is restored that was made before somebody joined, was revoked, used a join string.
#include "server/identity/restored_identity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>

#include "common/identity/certificate_request.h"
#include "common/identity/join_string.h"
#include "common/identity/private_key.h"
#include "server/identity/identity_authority.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::restored_identity_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Standing = server::AcceptedCertificates::Standing;

class RestoredIdentity : public ::testing::Test {
 protected:
  RestoredIdentity() { Open(); }

  void Open() {
    auto opened = server::IdentityAuthority::Open(live_, [this] { return now_; });
    ASSERT_THAT(opened, IsOk());
    authority_ = *std::move(opened);
    authority_->SetAddresses({.hosts = {"10.0.0.5"}, .grpc_port = 7420, .https_port = 7421});
  }
  // The state of the folder under this name.
  fs::path BackUp(const std::string& name) {
    fs::copy(live_, directory_.path() / name, fs::copy_options::recursive);
    return directory_.path() / name;
  }
  // As `rigcal-server restore` does.
  server::RestoredIdentity Restore(const fs::path& backup) {
    authority_.reset();
    const fs::path restored = directory_.path() / "restored";
    fs::copy(backup, restored, fs::copy_options::recursive);
    const auto result = server::TakeOverRevocations(live_, restored);
    EXPECT_THAT(result, IsOk());
    fs::remove_all(live_);
    fs::rename(restored, live_);
    Open();
    return result.ok() ? *result : server::RestoredIdentity();
  }
  std::string Secret(const std::string& name = "", Role role = Role::kAgent) {
    return ParseJoinString(authority_->CreateToken(role, absl::Hours(24), name)->join_string)
        ->secret;
  }
  std::string JoinWith(const std::string& secret, const std::string& name) {
    const auto issued =
        authority_->Enrol(secret, *MakeCertificateRequest(key_, name, Role::kAgent));
    EXPECT_THAT(issued, IsOk());
    return issued.ok() ? issued->certificate_pem : "";
  }
  std::string Join(const std::string& name) { return JoinWith(Secret(), name); }
  Standing StandingOf(const std::string& pem) {
    const Certificate certificate = *ParseCertificate(pem);
    return *server::AcceptedCertificates(live_).Find(certificate.uri, certificate.serial);
  }

  const TemporaryDirectory directory_;
  const fs::path live_ = directory_.path() / "live";
  absl::Time now_ = absl::FromUnixSeconds(1'795'000'000);
  const std::string key_ = *MakePrivateKey();
  std::unique_ptr<server::IdentityAuthority> authority_;
};

TEST_F(RestoredIdentity, LetsNobodyInAgain) {
  const std::string stays = Join("pc-stays");
  const std::string forgotten = Join("pc-forgotten");
  const std::string replaced = Join("pc-replaced");
  const std::string used = Secret();
  const std::string open = Secret();
  const std::string revoked_token =
      authority_->CreateToken(Role::kAgent, absl::Hours(24), "")->token.id;
  const fs::path backup = BackUp("backup");
  ASSERT_THAT(authority_->Revoke("rigcal://agents/pc-forgotten"), IsOk());
  ASSERT_THAT(authority_->RevokeToken(revoked_token), IsOk());
  now_ += absl::Hours(1);
  const std::string later = JoinWith(used, "pc-later");
  const std::string made_later = Secret();
  const std::string replacing = JoinWith(Secret("pc-replaced"), "pc-replaced");

  const server::RestoredIdentity result = Restore(backup);
  EXPECT_TRUE(result.compared);
  EXPECT_THAT(result.joined_since,
              ElementsAre("rigcal://agents/pc-later", "rigcal://agents/pc-replaced"));
  EXPECT_EQ(result.closed_tokens, 2u);
  EXPECT_EQ(StandingOf(stays), Standing::kAccepted);
  EXPECT_EQ(StandingOf(forgotten), Standing::kRevoked);
  EXPECT_EQ(StandingOf(replaced), Standing::kRevoked);
  EXPECT_EQ(StandingOf(later), Standing::kNotOnRecord);
  EXPECT_NE(StandingOf(replacing), Standing::kAccepted);
  const std::string request = *MakeCertificateRequest(*MakePrivateKey(), "pc-x", Role::kAgent);
  EXPECT_THAT(authority_->Enrol(used, request),
              StatusIs(absl::StatusCode::kPermissionDenied,
                       HasSubstr("was already used, at 2026-11-18T12:06:40Z by "
                                 "rigcal://agents/pc-later")));
  EXPECT_THAT(authority_->Enrol(made_later, request),
              StatusIs(absl::StatusCode::kPermissionDenied,
                       HasSubstr("was made after the backup that this server was restored from")));
  // Who lost his place can join again, and a string that nobody has used is still good.
  EXPECT_EQ(StandingOf(Join("pc-later")), Standing::kAccepted);
  EXPECT_EQ(StandingOf(JoinWith(open, "pc-forgotten")), Standing::kAccepted);
  EXPECT_EQ(StandingOf(forgotten), Standing::kRevoked);
}

TEST_F(RestoredIdentity, WhoRenewedSinceStaysIn) {
  const std::string first = Join("pc-1");
  const fs::path backup = BackUp("backup");
  now_ += absl::Hours(24 * 25);
  const auto renewed =
      authority_->Renew(first, *MakeCertificateRequest(key_, "pc-1", Role::kAgent));
  ASSERT_THAT(renewed, IsOk());
  EXPECT_THAT(Restore(backup).joined_since, IsEmpty());
  EXPECT_EQ(StandingOf(first), Standing::kAccepted);
  EXPECT_EQ(StandingOf(renewed->certificate_pem), Standing::kAccepted);
  ASSERT_THAT(authority_->Revoke("rigcal://agents/pc-1"), IsOk());
  EXPECT_EQ(StandingOf(renewed->certificate_pem), Standing::kRevoked);
}

// The older backup knows nobody, the newer one both: what was revoked in between stays so.
TEST_F(RestoredIdentity, ANewerBackupBringsNobodyBackEither) {
  const fs::path older = BackUp("older");
  const std::string kept = Join("pc-kept");
  const std::string forgotten = Join("pc-forgotten");
  const fs::path newer = BackUp("newer");
  EXPECT_THAT(Restore(older).joined_since,
              ElementsAre("rigcal://agents/pc-forgotten", "rigcal://agents/pc-kept"));
  EXPECT_EQ(StandingOf(kept), Standing::kNotOnRecord);
  ASSERT_THAT(authority_->Revoke("rigcal://agents/pc-forgotten"), IsOk());
  EXPECT_THAT(Restore(newer).joined_since, IsEmpty());
  EXPECT_EQ(StandingOf(kept), Standing::kAccepted);
  EXPECT_EQ(StandingOf(forgotten), Standing::kRevoked);
}

TEST_F(RestoredIdentity, BrowsersThatSignedOutStayOut) {
  const auto sign_in = [&] {
    return authority_
        ->SignIn(authority_->CreateToken(Role::kViewer, absl::Hours(24), "")->join_string)
        ->secret;
  };
  const std::string stays = sign_in();
  const std::string out = sign_in();
  const fs::path backup = BackUp("backup");
  ASSERT_THAT(authority_->SignOut(out), IsOk());
  const std::string later = sign_in();
  EXPECT_EQ(Restore(backup).ended_web_sessions, 1u);
  EXPECT_THAT(authority_->FindWebSession(stays), IsOk());
  for (const std::string& secret : {out, later}) {
    EXPECT_THAT(authority_->FindWebSession(secret),
                StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("sign in")));
  }
}

// Tokens that have left the list, and are in another one of the file.
TEST_F(RestoredIdentity, AStringThatIsNotInTheListAnyMoreIsUsed) {
  const std::string used = Secret();
  const fs::path backup = BackUp("backup");
  ReplaceTestFile(live_ / "tokens.json", R"({"tokens": [], "spent": ["5a", "5b"]})");
  EXPECT_EQ(Restore(backup).closed_tokens, 1u);
  EXPECT_THAT(authority_->Enrol(used, *MakeCertificateRequest(key_, "pc-1", Role::kAgent)),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("revoked")));
}

TEST_F(RestoredIdentity, WhatCannotBeComparedIsSaid) {
  const fs::path backup = BackUp("backup");
  Join("pc-1");
  const auto none = server::TakeOverRevocations(directory_.path() / "none", backup);
  ASSERT_THAT(none, IsOk());
  EXPECT_FALSE(none->compared);
  // Another server's: its lists are of other certificates.
  const TemporaryDirectory other;
  ASSERT_THAT(server::IdentityAuthority::Open(other.path(), [this] { return now_; }), IsOk());
  const auto foreign = server::TakeOverRevocations(other.path(), backup);
  ASSERT_THAT(foreign, IsOk());
  EXPECT_FALSE(foreign->compared);
  for (const char* name : {"denied.json", "identities.json"}) {
    ReplaceTestFile(live_ / name, "{");
    EXPECT_THAT(server::TakeOverRevocations(live_, backup),
                StatusIs(absl::StatusCode::kDataLoss,
                         ::testing::AllOf(HasSubstr(name), HasSubstr("move that file away"))));
    fs::remove(live_ / name);
  }
  // Lists without which everybody is kept out.
  ReplaceTestFile(live_ / "tokens.json", "{");
  ReplaceTestFile(live_ / "web_sessions.json", "{");
  EXPECT_THAT(server::TakeOverRevocations(live_, backup), IsOk());
}

}  // namespace
}  // namespace rigcal::testing::restored_identity_test
