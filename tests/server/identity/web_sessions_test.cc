// SPDX-License-Identifier: Apache-2.0
#include "server/identity/web_sessions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <string>

#include "common/file/durable_file.h"
#include "server/identity/identity_authority.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::web_sessions_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class WebSessions : public ::testing::Test {
 protected:
  void SetUp() override { Open(); }
  void Open() {
    auto opened = server::IdentityAuthority::Open(folder(), [this] { return now_; });
    ASSERT_THAT(opened, IsOk());
    authority_ = *std::move(opened);
    authority_->SetAddresses({.hosts = {"10.0.0.5"}, .grpc_port = 7420, .https_port = 7421});
  }
  std::filesystem::path folder() const { return data_.path() / "identity"; }
  std::string JoinStringFor(Role role, const std::string& name = "") {
    return authority_->CreateToken(role, absl::Hours(1), name)->join_string;
  }
  absl::StatusOr<server::WebSession> Find(const std::string& secret) {
    return authority_->FindWebSession(secret);
  }

  TemporaryDirectory data_;
  absl::Time now_ = absl::FromUnixSeconds(1'800'000'000);
  std::unique_ptr<server::IdentityAuthority> authority_;
};

TEST_F(WebSessions, ABrowserSignsInOnceWithAJoinString) {
  const std::string join = JoinStringFor(Role::kOperator, "anna");
  ASSERT_OK_AND_ASSIGN(const auto login, authority_->SignIn(join));
  ASSERT_OK_AND_ASSIGN(const server::WebSession session, Find(login.secret));
  EXPECT_EQ(session.name, "anna");
  EXPECT_EQ(session.role, Role::kOperator);
  EXPECT_THAT(authority_->SignIn(join),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("already used")));
  EXPECT_FALSE(Find(login.secret + "x").ok());
  EXPECT_FALSE(Find("").ok());
}

TEST_F(WebSessions, StayOverARestartWithoutTheirSecrets) {
  const std::string secret = authority_->SignIn(JoinStringFor(Role::kViewer))->secret;
  const std::string text = *ReadSmallFile(folder() / "web_sessions.json");
  EXPECT_THAT(text, Not(HasSubstr(secret)));
  Open();
  EXPECT_THAT(Find(secret), IsOk());
}

TEST_F(WebSessions, EndByThemselvesAndBySigningOut) {
  const std::string secret = authority_->SignIn(JoinStringFor(Role::kViewer))->secret;
  const std::string other = authority_->SignIn(JoinStringFor(Role::kViewer))->secret;
  ASSERT_THAT(authority_->SignOut(secret), IsOk());
  EXPECT_THAT(Find(secret), StatusIs(absl::StatusCode::kUnauthenticated, ::testing::_));
  EXPECT_THAT(Find(other), IsOk());
  now_ += server::kWebSessionLifetime;
  EXPECT_THAT(Find(other), StatusIs(absl::StatusCode::kUnauthenticated, HasSubstr("expired")));
}

TEST_F(WebSessions, EndWithTheirTokenAndTheirUser) {
  const std::string first = authority_->SignIn(JoinStringFor(Role::kViewer))->secret;
  const std::string second = authority_->SignIn(JoinStringFor(Role::kViewer, "kim"))->secret;
  const std::string third = authority_->SignIn(JoinStringFor(Role::kViewer))->secret;
  ASSERT_THAT(authority_->RevokeToken(authority_->ListTokens()[0].id), IsOk());
  EXPECT_FALSE(Find(first).ok());
  ASSERT_THAT(authority_->Revoke("rigcal://users/kim"), IsOk());
  EXPECT_FALSE(Find(second).ok());
  EXPECT_TRUE(Find(third).ok());
  EXPECT_THAT(authority_->Revoke("rigcal://users/kim"), IsOk()) << "nobody is left";
}

TEST_F(WebSessions, TakeNoJoinStringOfAnAgentOrOfAnotherServer) {
  EXPECT_THAT(authority_->SignIn(JoinStringFor(Role::kAgent)),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("for an agent")));
  const TemporaryDirectory other_data;
  auto other = server::IdentityAuthority::Open(other_data.path() / "identity");
  ASSERT_THAT(other, IsOk());
  (*other)->SetAddresses({.hosts = {"10.0.0.6"}, .grpc_port = 7420, .https_port = 7421});
  const std::string join = (*other)->CreateToken(Role::kViewer, absl::Hours(1), "")->join_string;
  EXPECT_THAT(authority_->SignIn(join),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("another server")));
  const std::string secret = (*other)->SignIn(join)->secret;
  EXPECT_THAT(Find(secret), StatusIs(absl::StatusCode::kUnauthenticated, ::testing::_));
  EXPECT_THAT(authority_->SignIn("rk1.nonsense"),
              StatusIs(absl::StatusCode::kInvalidArgument, ::testing::_));
}

TEST_F(WebSessions, ADamagedFileIsNamed) {
  std::ofstream(folder() / "web_sessions.json") << "{\"sessions\": [{}]}";
  EXPECT_THAT(server::IdentityAuthority::Open(folder()),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("web_sessions.json")));
}

}  // namespace
}  // namespace rigcal::testing::web_sessions_test
