// SPDX-License-Identifier: Apache-2.0
#include "server/identity/identity_authority.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/identity/certificate_request.h"
#include "common/identity/join_string.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"

namespace rigcal::server {
namespace {

std::string Quoted(std::string_view text) {
  return absl::StrCat("'", absl::CHexEscape(std::string(text.substr(0, 80))), "'");
}

bool IsPeerUri(std::string_view uri) {
  for (const Role role : {Role::kAgent, Role::kViewer}) {
    const std::string beginning = PeerUri(role, "");
    if (uri.starts_with(beginning)) {
      return ValidateName("", std::string(uri.substr(beginning.size()))).ok();
    }
  }
  return false;
}

}  // namespace

absl::StatusOr<std::unique_ptr<IdentityAuthority>> IdentityAuthority::Open(
    const std::filesystem::path& folder, std::function<absl::Time()> now) {
  RIGCAL_ASSIGN_OR_RETURN(CertificateAuthority ca, CertificateAuthority::Open(folder));
  RIGCAL_ASSIGN_OR_RETURN(TokenStore tokens, TokenStore::Open(folder / "tokens.json"));
  RIGCAL_ASSIGN_OR_RETURN(IdentityRegistry registry,
                          IdentityRegistry::Open(folder / "identities.json"));
  RIGCAL_ASSIGN_OR_RETURN(WebSessions web_sessions,
                          WebSessions::Open(folder / "web_sessions.json"));
  std::unique_ptr<IdentityAuthority> authority(
      new IdentityAuthority(folder, std::move(now), std::move(ca), std::move(tokens),
                            std::move(registry), std::move(web_sessions)));
  RIGCAL_RETURN_IF_ERROR(authority->accepted_.Find("", "").status());
  return authority;
}

IdentityAuthority::IdentityAuthority(std::filesystem::path folder, std::function<absl::Time()> now,
                                     CertificateAuthority ca, TokenStore tokens,
                                     IdentityRegistry registry, WebSessions web_sessions)
    : now_(std::move(now)),
      ca_(std::move(ca)),
      accepted_(folder),
      tokens_(std::move(tokens)),
      registry_(std::move(registry)),
      web_sessions_(std::move(web_sessions)) {}

void IdentityAuthority::SetNameHolder(NameHolder holder_of) {
  const std::lock_guard lock(mutex_);
  holder_of_ = std::move(holder_of);
}

void IdentityAuthority::SetAddresses(ServerAddresses addresses) {
  const std::lock_guard lock(mutex_);
  addresses_ = std::move(addresses);
}

absl::StatusOr<IdentityAuthority::JoinToken> IdentityAuthority::CreateToken(
    Role role, absl::Duration ttl, const std::string& name) {
  if (role == Role::kAdmin) {
    return absl::InvalidArgumentError(
        "no join string is made for the role admin: identities are managed on the server PC");
  }
  if (!name.empty()) RIGCAL_RETURN_IF_ERROR(ValidateName("name", name));
  if (ttl < absl::Seconds(1) || ttl > kLongestTokenTtl) {
    return absl::InvalidArgumentError(absl::StrCat("the life of a join string is 1 s to ",
                                                   absl::FormatDuration(kLongestTokenTtl), ", not ",
                                                   absl::FormatDuration(ttl)));
  }
  const std::lock_guard lock(mutex_);
  if (addresses_.hosts.empty()) {
    return absl::FailedPreconditionError(
        "this server has no address that another PC reaches: connect it to the network");
  }
  RIGCAL_ASSIGN_OR_RETURN(TokenStore::Created created, tokens_.Create(role, ttl, name, now_()));
  std::vector<std::string> hosts = addresses_.hosts;
  if (hosts.size() > kMaxJoinHosts) hosts.resize(kMaxJoinHosts);
  const JoinString join = {.role = role,
                           .expiry = created.token.expires,
                           .ca_sha256 = ca_.sha256(),
                           .secret = std::move(created.secret),
                           .name = name,
                           .grpc_port = addresses_.grpc_port,
                           .https_port = addresses_.https_port,
                           .hosts = std::move(hosts)};
  return JoinToken{std::move(created.token), FormatJoinString(join)};
}

std::vector<Token> IdentityAuthority::ListTokens() const {
  const std::lock_guard lock(mutex_);
  return tokens_.tokens();
}

absl::Status IdentityAuthority::RevokeToken(std::string_view id) {
  const std::lock_guard lock(mutex_);
  const absl::StatusOr<Token> revoked = tokens_.Revoke(id);
  if (!revoked.ok() && !absl::IsNotFound(revoked.status())) return revoked.status();
  // Also of a token that has left the list.
  RIGCAL_ASSIGN_OR_RETURN(
      const size_t browsers,
      web_sessions_.RemoveIf([&](const WebSession& session) { return session.token_id == id; }));
  if (!revoked.ok()) return browsers > 0 ? absl::OkStatus() : revoked.status();
  const Token& token = *revoked;
  // Browsers have no key.
  if (!token.used || token.key_sha256.empty()) return absl::OkStatus();
  // Somebody else may have joined under that name since, with another token.
  const IdentityRecord* const record = registry_.Find(token.used_by);
  if (record != nullptr && record->joined != *token.used) return absl::OkStatus();
  return RevokeLocked(token.used_by);
}

std::vector<IdentityRecord> IdentityAuthority::ListIdentities() const {
  const std::lock_guard lock(mutex_);
  return registry_.List();
}

absl::Status IdentityAuthority::Revoke(std::string_view uri) {
  if (!IsPeerUri(uri)) {
    return absl::InvalidArgumentError(absl::StrCat(
        Quoted(uri), " is nobody's URI; they are rigcal://agents/NAME and rigcal://users/NAME"));
  }
  const std::lock_guard lock(mutex_);
  return RevokeLocked(uri);
}

absl::Status IdentityAuthority::RevokeLocked(std::string_view uri) {
  RIGCAL_ASSIGN_OR_RETURN(const size_t browsers,
                          web_sessions_.RemoveIf([&](const WebSession& session) {
                            return PeerUri(session.role, session.name) == uri;
                          }));
  RIGCAL_RETURN_IF_ERROR(DenyBeforeLocked(std::string(uri)));
  if (registry_.Find(uri) == nullptr) {
    spdlog::info("{} is revoked: it is not on record, and {} browsers had signed in", uri,
                 browsers);
    return absl::OkStatus();
  }
  spdlog::info("{} is revoked", uri);
  return registry_.MarkRevoked(uri, now_());
}

absl::Status IdentityAuthority::DenyBeforeLocked(const std::string& uri) {
  std::set<std::string> serials;
  if (const IdentityRecord* const record = registry_.Find(uri)) {
    for (const auto& [serial, expires] : record->serials) serials.insert(serial);
  }
  return accepted_.denied().Deny(uri, serials, now_());
}

absl::StatusOr<IdentityAuthority::Issued> IdentityAuthority::Enrol(std::string_view secret,
                                                                   std::string_view request_pem) {
  RIGCAL_ASSIGN_OR_RETURN(const CertificateRequest request, ParseCertificateRequest(request_pem));
  const std::string key_sha256 = absl::BytesToHexString(Sha256(request.public_key));
  const std::lock_guard lock(mutex_);
  // In whole seconds, as in the files.
  const absl::Time now = absl::FromUnixSeconds(absl::ToUnixSeconds(now_()));
  RIGCAL_ASSIGN_OR_RETURN(const Token token, tokens_.Find(secret, key_sha256, now));
  if (request.role != RoleName(token.role)) {
    return absl::PermissionDeniedError(
        absl::StrCat("the join string is for the role ", std::string(RoleName(token.role)),
                     ", and the request asks for ", Quoted(request.role)));
  }
  RIGCAL_RETURN_IF_ERROR(ValidateName("name in the certificate request", request.name));
  if (!token.name.empty() && request.name != token.name) {
    return absl::PermissionDeniedError(absl::StrCat("the join string is for ", token.name,
                                                    ", and the request for ", request.name));
  }
  const std::string uri = PeerUri(token.role, request.name);
  const IdentityRecord* const before = registry_.Find(uri);
  // An answer that got lost is given again.
  const bool again = token.used.has_value();
  if (again && (token.used_by != uri || before == nullptr || before->revoked)) {
    return absl::PermissionDeniedError(
        absl::StrCat("the join string was already used by ", token.used_by, "; make a new one"));
  }
  if (token.name.empty() && !again) {
    RIGCAL_RETURN_IF_ERROR(CheckNameFree(token.role, request.name));
  }
  if (!again) {
    RIGCAL_RETURN_IF_ERROR(tokens_.MarkUsed(token.id, uri, key_sha256, now));
    if (before != nullptr) RIGCAL_RETURN_IF_ERROR(DenyBeforeLocked(uri));
  }
  spdlog::info("{} joins as {} with token {}", uri, std::string(RoleName(token.role)), token.id);
  return IssueLocked({token.role, request.name, request.public_key}, /*joins=*/!again, now);
}

absl::Status IdentityAuthority::CheckNameFree(Role role, const std::string& name) const {
  const IdentityRecord* const before = registry_.Find(PeerUri(role, name));
  const bool has_joined = before != nullptr && !before->revoked;
  const std::string holder = role == Role::kAgent ? holder_of_(name) : "";
  if (!has_joined && holder.empty()) return absl::OkStatus();
  return absl::AlreadyExistsError(absl::StrCat(
      has_joined ? absl::StrCat(name, " has joined already")
                 : absl::StrCat("this server knows an agent ", name, " ", holder,
                                ", which would lose its name and its cameras"),
      ". Choose another name; or, if this PC replaces that one, use a join string made for it: "
      "rigcal token create --role ",
      std::string(RoleName(role)), " --name ", name,
      role == Role::kAgent ? absl::StrCat("; or free the name: rigcal agent forget ", name) : ""));
}

absl::StatusOr<IdentityAuthority::Issued> IdentityAuthority::Renew(std::string_view certificate_pem,
                                                                   std::string_view request_pem) {
  const absl::StatusOr<Certificate> parsed = ParseOnlyCertificate(certificate_pem);
  if (!parsed.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the certificate ", std::string(parsed.status().message())));
  }
  const Certificate& certificate = *parsed;
  RIGCAL_RETURN_IF_ERROR(CheckIssuedBy(certificate, ca_.pem(), CertificateUse::kClient));
  RIGCAL_ASSIGN_OR_RETURN(const CertificateRequest request, ParseCertificateRequest(request_pem));
  if (!certificate.role || certificate.uri != PeerUri(*certificate.role, certificate.name)) {
    return absl::UnauthenticatedError("the certificate names neither an agent nor a user");
  }
  const std::lock_guard lock(mutex_);
  const absl::Time now = now_();
  RIGCAL_ASSIGN_OR_RETURN(const AcceptedCertificates::Standing standing,
                          accepted_.Find(certificate.uri, certificate.serial));
  if (standing == AcceptedCertificates::Standing::kRevoked) {
    return absl::PermissionDeniedError(
        absl::StrCat("the certificate of ", certificate.uri,
                     " was revoked; join again with a new "
                     "join string, which rigcal token create prints on the server PC"));
  }
  if (request.public_key != PublicKeyOf(certificate.pem) || request.name != certificate.name ||
      request.role != RoleName(*certificate.role)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the request is not for the name, role and key of the certificate of ", certificate.uri));
  }
  if (certificate.not_after + kRenewalGrace < now) {
    return absl::UnauthenticatedError(
        absl::StrCat("the certificate of ", certificate.uri, " ended at ",
                     absl::FormatTime("%Y-%m-%d", certificate.not_after, absl::UTCTimeZone()),
                     ", too long ago to be renewed; join again with a new join string"));
  }
  if (standing != AcceptedCertificates::Standing::kAccepted) {
    return absl::PermissionDeniedError(
        absl::StrCat("the certificate of ", certificate.uri, " ", WhyNotAccepted(standing)));
  }
  // By this server's clock alone: those of PCs may be wrong.
  const absl::Time issued = certificate.not_before + kPeerBackdate;
  const bool is_due = now < issued - kPeerBackdate || now >= issued + kPeerLifetime * 2 / 3;
  if (!is_due) return AnswerLocked(certificate.pem);
  return IssueLocked({*certificate.role, certificate.name, request.public_key}, /*joins=*/false,
                     now);
}

absl::StatusOr<IdentityAuthority::Issued> IdentityAuthority::IssueLocked(
    const CertificateAuthority::PeerRequest& request, bool joins, absl::Time now) {
  RIGCAL_ASSIGN_OR_RETURN(std::string pem, ca_.IssuePeer(request, now));
  RIGCAL_ASSIGN_OR_RETURN(const Certificate certificate, ParseCertificate(pem));
  // On record before it is given out: else it could not be revoked.
  RIGCAL_RETURN_IF_ERROR(registry_.Record(certificate, joins, now));
  RIGCAL_RETURN_IF_ERROR(accepted_.denied().Accept(certificate.uri, certificate.serial));
  return AnswerLocked(std::move(pem));
}

absl::StatusOr<IdentityAuthority::WebLogin> IdentityAuthority::SignIn(
    std::string_view join_string) {
  RIGCAL_ASSIGN_OR_RETURN(const JoinString join, ParseJoinString(join_string));
  if (join.ca_sha256 != ca_.sha256()) {
    return absl::PermissionDeniedError(
        "the join string is of another server; make one on this server's PC with rigcal token "
        "create --role viewer");
  }
  if (join.role == Role::kAgent) {
    return absl::PermissionDeniedError(
        "the join string is for an agent; make one for a person: rigcal token create --role "
        "operator, or --role viewer");
  }
  const std::lock_guard lock(mutex_);
  const absl::Time now = absl::FromUnixSeconds(absl::ToUnixSeconds(now_()));
  // No browser can use it again: it has no key that would prove it is the same.
  RIGCAL_ASSIGN_OR_RETURN(const Token token, tokens_.Find(join.secret, "", now));
  if (token.used) {
    return absl::PermissionDeniedError(
        absl::StrCat("the join string was already used by ", token.used_by, "; make a new one"));
  }
  WebLogin login;
  login.session = {
      .token_id = token.id,
      .role = token.role,
      .name = token.name.empty() ? absl::StrCat("browser-", token.id.substr(2)) : token.name,
      .created = now,
      .expires = now + kWebSessionLifetime};
  const std::string uri = PeerUri(token.role, login.session.name);
  RIGCAL_RETURN_IF_ERROR(tokens_.MarkUsed(token.id, uri, "", now));
  RIGCAL_ASSIGN_OR_RETURN(login.secret, web_sessions_.Create(login.session, now));
  spdlog::info("{} signs in as {} with token {}", uri, std::string(RoleName(token.role)), token.id);
  return login;
}

absl::StatusOr<WebSession> IdentityAuthority::FindWebSession(std::string_view secret) const {
  const std::lock_guard lock(mutex_);
  const std::optional<WebSession> session = web_sessions_.Find(secret, now_());
  if (session) return *session;
  return absl::UnauthenticatedError(
      "this browser is not signed in here any more: the cookie is of another server, or has "
      "expired, or was revoked; sign in with a new join string (rigcal token create --role viewer "
      "on the server's PC)");
}

absl::Status IdentityAuthority::SignOut(std::string_view secret) {
  const std::lock_guard lock(mutex_);
  return web_sessions_.Remove(secret);
}

IdentityAuthority::Issued IdentityAuthority::AnswerLocked(std::string certificate_pem) const {
  return {.certificate_pem = std::move(certificate_pem),
          .ca_pem = ca_.pem(),
          .grpc = HostPorts(addresses_.hosts, addresses_.grpc_port),
          .https = HostPorts(addresses_.hosts, addresses_.https_port)};
}

}  // namespace rigcal::server
