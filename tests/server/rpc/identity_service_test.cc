// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/identity/certificate_request.h"
#include "common/identity/join_string.h"
#include "common/identity/private_key.h"
#include "common/wire/grpc_status.h"
#include "rigcal/v1/identity_service.grpc.pb.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::identity_service_test {
namespace {

using ::testing::HasSubstr;

class IdentityService : public RpcFixture {
 protected:
  void SetUp() override {
    auto opened = server::IdentityAuthority::Open(folder_.path());
    ASSERT_THAT(opened, IsOk());
    identities_ = *std::move(opened);
    identities_->SetAddresses({.hosts = {"10.0.0.5"}, .grpc_port = 7420, .https_port = 7421});
    RpcFixture::SetUp();
  }
  template <typename Request, typename Response>
  absl::Status Call(grpc::Status (v1::IdentityService::Stub::*method)(grpc::ClientContext*,
                                                                      const Request&, Response*),
                    const Request& request, Response* response) {
    grpc::ClientContext context;
    v1::IdentityService::Stub stub(channel());
    return wire::FromGrpc((stub.*method)(&context, request, response));
  }
  using Stub = v1::IdentityService::Stub;

  const TemporaryDirectory folder_;
};

TEST_F(IdentityService, MakesAJoinStringAndForgetsWhoUsedIt) {
  v1::CreateTokenRequest request;
  request.set_role(v1::ROLE_VIEWER);
  request.mutable_ttl()->set_seconds(600);
  request.set_name("anna");
  v1::CreateTokenResponse made;
  ASSERT_THAT(Call(&Stub::CreateToken, request, &made), IsOk());
  ASSERT_OK_AND_ASSIGN(const rigcal::JoinString join, ParseJoinString(made.join_string()));
  EXPECT_EQ(join.role, Role::kViewer);
  EXPECT_EQ(join.name, "anna");
  EXPECT_EQ(made.token().expire_time().seconds(), absl::ToUnixSeconds(join.expiry));
  const std::string key = *MakePrivateKey();
  ASSERT_THAT(identities_->Enrol(join.secret, *MakeCertificateRequest(key, "anna", Role::kViewer)),
              IsOk());

  v1::ListTokensResponse tokens;
  ASSERT_THAT(Call(&Stub::ListTokens, {}, &tokens), IsOk());
  ASSERT_EQ(tokens.tokens_size(), 1);
  EXPECT_EQ(tokens.tokens(0).id(), made.token().id());
  EXPECT_EQ(tokens.tokens(0).used_by(), "rigcal://users/anna");
  EXPECT_TRUE(tokens.tokens(0).has_use_time());
  v1::ListIdentitiesResponse identities;
  ASSERT_THAT(Call(&Stub::ListIdentities, {}, &identities), IsOk());
  ASSERT_EQ(identities.identities_size(), 1);
  EXPECT_EQ(identities.identities(0).uri(), "rigcal://users/anna");
  EXPECT_EQ(identities.identities(0).role(), v1::ROLE_VIEWER);
  EXPECT_FALSE(identities.identities(0).has_revoke_time());

  v1::RevokeRequest revoke;
  revoke.set_uri("rigcal://users/anna");
  v1::RevokeResponse revoked;
  ASSERT_THAT(Call(&Stub::Revoke, revoke, &revoked), IsOk());
  ASSERT_THAT(Call(&Stub::ListIdentities, {}, &identities), IsOk());
  EXPECT_TRUE(identities.identities(0).has_revoke_time());
}

TEST_F(IdentityService, RefusesWhatMakesNoSense) {
  v1::CreateTokenRequest request;
  v1::CreateTokenResponse made;
  ASSERT_THAT(Call(&Stub::CreateToken, request, &made), IsOk());
  EXPECT_EQ(made.token().role(), v1::ROLE_AGENT);
  request.set_role(v1::ROLE_ADMIN);
  EXPECT_THAT(Call(&Stub::CreateToken, request, &made),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("admin")));
  request.set_role(static_cast<v1::Role>(77));
  EXPECT_THAT(Call(&Stub::CreateToken, request, &made),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("77")));
  request.set_role(v1::ROLE_AGENT);
  request.mutable_ttl()->set_seconds(-1);
  EXPECT_THAT(Call(&Stub::CreateToken, request, &made),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("ttl")));
  v1::RevokeTokenRequest token;
  token.set_id("t-nobody");
  v1::RevokeTokenResponse no_token;
  EXPECT_THAT(Call(&Stub::RevokeToken, token, &no_token),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("t-nobody")));
  v1::RevokeRequest revoke;
  revoke.set_uri("rigcal://agents/\n\x1b[2J");
  v1::RevokeResponse nobody;
  const absl::Status status = Call(&Stub::Revoke, revoke, &nobody);
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("\\n")));
  revoke.set_uri("rigcal://agents/pc-9");
  EXPECT_THAT(Call(&Stub::Revoke, revoke, &nobody), IsOk()) << "it may have a certificate";
}

TEST_F(IdentityService, SaysHowToServeOtherPcs) {
  CloseServer();
  identities_.reset();
  OpenServer();
  v1::ListTokensResponse tokens;
  EXPECT_THAT(Call(&Stub::ListTokens, {}, &tokens),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("--listen 0.0.0.0")));
}

}  // namespace
}  // namespace rigcal::testing::identity_service_test
