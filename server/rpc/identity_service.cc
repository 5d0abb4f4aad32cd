// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/status/status_macros.h"
#include "common/wire/time_wire.h"
#include "rigcal/v1/identity_service.grpc.pb.h"
#include "server/identity/identity_authority.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/services.h"
#include "server/session/agent_registry.h"

namespace rigcal::server {
namespace {

google::protobuf::Timestamp TimestampOf(absl::Time time) {
  return wire::ToTimestamp(absl::ToUnixNanos(time));
}

v1::Token TokenToProto(const Token& token) {
  v1::Token proto;
  proto.set_id(token.id);
  proto.set_role(static_cast<v1::Role>(token.role));
  proto.set_name(token.name);
  *proto.mutable_create_time() = TimestampOf(token.created);
  *proto.mutable_expire_time() = TimestampOf(token.expires);
  proto.set_revoked(token.revoked);
  if (token.used) *proto.mutable_use_time() = TimestampOf(*token.used);
  proto.set_used_by(token.used_by);
  return proto;
}

v1::Identity IdentityToProto(const IdentityRecord& record) {
  v1::Identity proto;
  proto.set_uri(record.uri);
  proto.set_name(record.name);
  proto.set_role(static_cast<v1::Role>(record.role));
  *proto.mutable_join_time() = TimestampOf(record.joined);
  *proto.mutable_expire_time() = TimestampOf(record.expires);
  if (record.revoked) *proto.mutable_revoke_time() = TimestampOf(*record.revoked);
  return proto;
}

class IdentityService final : public v1::IdentityService::Service {
 public:
  explicit IdentityService(const RpcServerParts& parts)
      : authority_(parts.identities), registry_(parts.registry) {}

  grpc::Status CreateToken(grpc::ServerContext*, const v1::CreateTokenRequest* request,
                           v1::CreateTokenResponse* response) override {
    return Guard("CreateToken", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const Role role, RoleOf(request->role()));
      absl::Duration ttl = kDefaultTokenTtl;
      if (request->has_ttl()) {
        RIGCAL_ASSIGN_OR_RETURN(const uint32_t ttl_ms, wire::MillisecondsOf(request->ttl(), "ttl"));
        ttl = absl::Milliseconds(ttl_ms);
      }
      RIGCAL_ASSIGN_OR_RETURN(IdentityAuthority::JoinToken made,
                              authority_->CreateToken(role, ttl, request->name()));
      *response->mutable_token() = TokenToProto(made.token);
      response->set_join_string(std::move(made.join_string));
      return absl::OkStatus();
    });
  }

  grpc::Status ListTokens(grpc::ServerContext*, const v1::ListTokensRequest*,
                          v1::ListTokensResponse* response) override {
    return Guard("ListTokens", [&] {
      for (const Token& token : authority_->ListTokens()) {
        *response->add_tokens() = TokenToProto(token);
      }
      return absl::OkStatus();
    });
  }

  grpc::Status RevokeToken(grpc::ServerContext*, const v1::RevokeTokenRequest* request,
                           v1::RevokeTokenResponse*) override {
    return Guard("RevokeToken", [&] { return authority_->RevokeToken(request->id()); });
  }

  grpc::Status ListIdentities(grpc::ServerContext*, const v1::ListIdentitiesRequest*,
                              v1::ListIdentitiesResponse* response) override {
    return Guard("ListIdentities", [&] {
      for (const IdentityRecord& record : authority_->ListIdentities()) {
        *response->add_identities() = IdentityToProto(record);
      }
      return absl::OkStatus();
    });
  }

  grpc::Status Revoke(grpc::ServerContext*, const v1::RevokeRequest* request,
                      v1::RevokeResponse*) override {
    return Guard("Revoke", [&]() -> absl::Status {
      const absl::Status revoked = authority_->Revoke(request->uri());
      if (!revoked.ok() && !absl::IsNotFound(revoked)) return revoked;
      // An agent without a certificate has its name and its cameras all the same.
      absl::string_view name = request->uri();
      if (registry_ == nullptr || !absl::ConsumePrefix(&name, PeerUri(Role::kAgent, ""))) {
        return revoked;
      }
      RIGCAL_ASSIGN_OR_RETURN(const bool known,
                              registry_->Forget(std::string_view(name.data(), name.size())));
      return known ? absl::OkStatus() : revoked;
    });
  }

 private:
  template <typename Body>
  grpc::Status Guard(const char* rpc, Body&& body) {
    return GuardedCall(rpc, [&]() -> absl::Status {
      if (authority_ != nullptr) return std::forward<Body>(body)();
      return absl::FailedPreconditionError(
          "nobody can join this server: it listens on its own PC only, where nobody needs a "
          "certificate (start it with rigcal-server --listen 0.0.0.0 to let other PCs join), or it "
          "has "
          "certificates of another CA");
    });
  }

  static absl::StatusOr<Role> RoleOf(v1::Role role) {
    if (role == v1::ROLE_UNSPECIFIED) return Role::kAgent;
    if (v1::Role_IsValid(role)) return static_cast<Role>(role);
    return absl::InvalidArgumentError(
        absl::StrCat("role: ", static_cast<int>(role), " is not known"));
  }

  IdentityAuthority* const authority_;
  AgentRegistry* const registry_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeIdentityService(const RpcServerParts& parts) {
  return std::make_unique<IdentityService>(parts);
}

}  // namespace rigcal::server
