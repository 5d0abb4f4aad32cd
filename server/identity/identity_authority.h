// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/identity/accepted_certificates.h"
#include "server/identity/certificate_authority.h"
#include "server/identity/identity_registry.h"
#include "server/identity/token_store.h"
#include "server/identity/web_sessions.h"

namespace rigcal::server {

inline constexpr absl::Duration kDefaultTokenTtl = absl::Hours(1);
inline constexpr absl::Duration kLongestTokenTtl = absl::Hours(24 * 30);

// Where this server is reached, for join strings and those who have joined.
struct ServerAddresses {
  std::vector<std::string> hosts;
  uint16_t grpc_port = 0;
  uint16_t https_port = 0;
};

// Who may talk with this server: makes join strings, gives out certificates for them, renews them,
// revokes them. All of it is in files of one folder, and on disk before it is answered.
// Thread-safe.
class IdentityAuthority {
 public:
  // `folder` is IdentityDirectory(data_dir); what it needs is made.
  static absl::StatusOr<std::unique_ptr<IdentityAuthority>> Open(
      const std::filesystem::path& folder, std::function<absl::Time()> now = absl::Now);

  // Which agent without a certificate has a name: "on host 'pc-7', with camera rig/left"; empty:
  // none. A join string without a name gives nobody his name. By default nobody has one. Before
  // anybody joins; called with a lock held, from any thread.
  using NameHolder = std::function<std::string(const std::string& agent_id)>;
  void SetNameHolder(NameHolder holder_of);
  // Before join strings are made, and whenever it changes.
  void SetAddresses(ServerAddresses addresses);
  const std::string& ca_pem() const { return ca_.pem(); }

  struct JoinToken {
    Token token;
    std::string join_string;
  };
  // INVALID_ARGUMENT: the role is admin, the name is none, or the ttl is not within 1 s and
  // kLongestTokenTtl. FAILED_PRECONDITION: the server has no address that others reach.
  absl::StatusOr<JoinToken> CreateToken(Role role, absl::Duration ttl, const std::string& name);
  std::vector<Token> ListTokens() const;
  // A token that was used takes the identity or browser with it that joined by it. NOT_FOUND: no
  // such token.
  absl::Status RevokeToken(std::string_view id);

  std::vector<IdentityRecord> ListIdentities() const;
  // From now on no certificate of this URI is accepted, unless it joins again. Also for a URI that
  // is not on record: there may be certificates of it, given out after the backup that was restored
  // here, and later a backup that knows them. INVALID_ARGUMENT: it is no URI of an agent or user.
  absl::Status Revoke(std::string_view uri);

  // What who has joined gets.
  struct Issued {
    std::string certificate_pem;
    std::string ca_pem;
    std::vector<std::string> grpc;   // HOST:PORT
    std::vector<std::string> https;  // HOST:PORT
  };
  // For a secret out of a join string, and a certificate request.
  //   PERMISSION_DENIED  the secret is unknown, used, expired or revoked, or is for another role or
  //                      name than the request
  //   INVALID_ARGUMENT   the request is damaged, or not signed with its key
  //   ALREADY_EXISTS     somebody of that name has joined, or is known without a certificate; a
  //                      token made for the name replaces him
  absl::StatusOr<Issued> Enrol(std::string_view secret, std::string_view request_pem);
  // For the holder of a certificate: the request is for the same name, role and key. One that is
  // not due yet gets the certificate that it has.
  //   UNAUTHENTICATED    the certificate is not of this CA, or too long expired
  //   PERMISSION_DENIED  it was revoked, or is not on record
  //   INVALID_ARGUMENT   the request is damaged, or is not for this certificate
  absl::StatusOr<Issued> Renew(std::string_view certificate_pem, std::string_view request_pem);

  // A browser that signs in with a join string, which it uses up.
  struct WebLogin {
    std::string secret;  // the cookie's value
    WebSession session;
  };
  //   INVALID_ARGUMENT   it is no join string
  //   PERMISSION_DENIED  it is of another server, is for an agent, or was used, expired or revoked
  absl::StatusOr<WebLogin> SignIn(std::string_view join_string);
  // UNAUTHENTICATED: no browser has signed in with this cookie here, or that was revoked or ended.
  absl::StatusOr<WebSession> FindWebSession(std::string_view secret) const;
  absl::Status SignOut(std::string_view secret);

 private:
  IdentityAuthority(std::filesystem::path folder, std::function<absl::Time()> now,
                    CertificateAuthority ca, TokenStore tokens, IdentityRegistry registry,
                    WebSessions web_sessions);

  absl::Status RevokeLocked(std::string_view uri);
  absl::Status DenyBeforeLocked(const std::string& uri);
  absl::StatusOr<Issued> IssueLocked(const CertificateAuthority::PeerRequest& request, bool joins,
                                     absl::Time now);
  // ALREADY_EXISTS: somebody has the name, which a token without a name does not give.
  absl::Status CheckNameFree(Role role, const std::string& name) const;
  Issued AnswerLocked(std::string certificate_pem) const;

  const std::function<absl::Time()> now_;
  const CertificateAuthority ca_;
  AcceptedCertificates accepted_;
  mutable std::mutex mutex_;
  ServerAddresses addresses_;
  NameHolder holder_of_ = [](const std::string&) { return std::string(); };
  TokenStore tokens_;
  IdentityRegistry registry_;
  WebSessions web_sessions_;
};

}  // namespace rigcal::server
