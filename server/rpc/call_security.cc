// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/call_security.h"

#include <grpc/grpc_security_constants.h>
#include <spdlog/spdlog.h>

#include <optional>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "server/access/access_rules.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxKnown = 4096;
constexpr size_t kKeyBytes = 16;
// What a small message needs besides its bytes: headers of its frames and of TLS records.
constexpr size_t kMessageOverheadBytes = 64;
// Metadata of calls within the process; values end in "-bin" where they may hold any bytes.
constexpr char kKey[] = "rigcal-key";
constexpr char kRole[] = "rigcal-role";
constexpr char kName[] = "rigcal-name-bin";
constexpr char kAddress[] = "rigcal-address-bin";

std::string MetadataOf(const grpc::ServerContextBase& context, const char* key) {
  const auto found = context.client_metadata().find(key);
  if (found == context.client_metadata().end()) return "";
  return std::string(found->second.data(), found->second.size());
}

}  // namespace

CallSecurity::CallSecurity(const CheckedIdentity* identity, AcceptedCertificates* accepted,
                           Connections* connections, PeerConduct* conduct, AuditLog* audit)
    : identity_(identity),
      accepted_(accepted),
      connections_(connections),
      conduct_(conduct),
      audit_(*audit),
      key_(absl::BytesToHexString(RandomBytes(kKeyBytes).value_or(""))) {}

std::string AddressOfUri(std::string_view uri) {
  if (!uri.starts_with("ipv4:") && !uri.starts_with("ipv6:")) return "";
  return absl::StrReplaceAll(std::string(uri.substr(5)),
                             {{"%5B", "["}, {"%5D", "]"}, {"%5b", "["}, {"%5d", "]"}});
}

absl::StatusOr<Peer> CallSecurity::Identify(std::string_view certificate_pem) {
  if (identity_ == nullptr) return absl::UnauthenticatedError("this server has no certificates");
  const std::shared_ptr<const TrustedCa> ca = identity_->ca();
  const absl::Time now = identity_->Now();
  Peer peer;
  {
    std::lock_guard lock(mutex_);
    if (known_by_ != ca || known_.size() >= kMaxKnown) known_.clear();
    known_by_ = ca;
    const auto known = known_.find(certificate_pem);
    if (known != known_.end() && absl::ToUnixSeconds(now) <= known->second.not_after_utc_s) {
      peer = known->second;
    }
  }
  if (!peer.has_certificate) {
    RIGCAL_ASSIGN_OR_RETURN(peer, ca->Identify(certificate_pem, now));
    std::lock_guard lock(mutex_);
    if (known_by_ == ca) known_[std::string(certificate_pem)] = peer;
  }
  if (accepted_ == nullptr) return peer;
  const auto standing = accepted_->Find(peer.uri, peer.serial);
  if (!standing.ok()) {
    return absl::PermissionDeniedError(absl::StrCat(
        Describe(peer), " cannot be checked: ", std::string(standing.status().message())));
  }
  if (*standing == AcceptedCertificates::Standing::kAccepted) return peer;
  return absl::PermissionDeniedError(absl::StrCat(Describe(peer), " ", WhyNotAccepted(*standing)));
}

std::string CallSecurity::WhyToCut(const Peer& peer) {
  if (accepted_ == nullptr || identity_ == nullptr || !peer.has_certificate) return "";
  const auto standing = accepted_->Find(peer.uri, peer.serial);
  if (!standing.ok()) return "its certificate cannot be checked";
  if (*standing == AcceptedCertificates::Standing::kRevoked) return "its certificate was revoked";
  if (*standing == AcceptedCertificates::Standing::kNotOnRecord) {
    return "its certificate is not on record";
  }
  if (absl::ToUnixSeconds(identity_->Now()) <= peer.not_after_utc_s) return "";
  return absl::StrCat(
      "its certificate has ended, at ",
      absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", absl::FromUnixSeconds(peer.not_after_utc_s),
                       absl::UTCTimeZone()));
}

absl::StatusOr<Peer> CallSecurity::IdentifyFrom(const grpc::AuthContext& context) {
  const std::vector<grpc::string_ref> certificate =
      context.FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
  // Only connections from this machine come in without TLS, and with TLS not without certificate.
  if (certificate.empty()) return Peer();
  return Identify(std::string_view(certificate[0].data(), certificate[0].size()));
}

absl::StatusOr<Peer> CallSecurity::Welcome(std::string_view certificate_pem) {
  RIGCAL_ASSIGN_OR_RETURN(Peer peer, Identify(certificate_pem));
  const auto now = PeerConduct::Clock::now();
  if (conduct_ != nullptr) RIGCAL_RETURN_IF_ERROR(CheckConduct(peer, now));
  if (connections_ != nullptr) connections_->NoteHandshake(peer, now);
  return peer;
}

absl::Status CallSecurity::CheckConduct(const Peer& peer, PeerConduct::Clock::time_point now) {
  const std::optional<PeerConduct::Banned> ban = conduct_->FindBan(peer.uri, now);
  if (!ban) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat(Describe(peer), " is kept out for another ", ban->left.count(),
                   " s, because its connection flooded the server: ", ban->why));
}

absl::Status CallSecurity::BeginCall(const Peer& peer) {
  if (conduct_ == nullptr || !peer.has_certificate) return absl::OkStatus();
  const auto now = PeerConduct::Clock::now();
  RIGCAL_RETURN_IF_ERROR(CheckConduct(peer, now));
  if (conduct_->BeginCall(peer.uri, now)) return absl::OkStatus();
  const std::string why = "it has begun thousands of calls that it did not wait for";
  const auto ban = conduct_->Ban(peer.uri, why, now);
  spdlog::error("{} floods the server, is cut and kept out for {} s: {}", Describe(peer),
                ban.count(), why);
  audit_.Write("connection_cut", Describe(peer),
               {{"reason", absl::StrCat(why, "; it is kept out for ", ban.count(), " s")}});
  if (connections_ != nullptr) {
    connections_->NoteFlood(peer, why);
    connections_->CutIf([&](const Peer& other) { return other.uri == peer.uri; });
  }
  return absl::ResourceExhaustedError(absl::StrCat(Describe(peer), " is cut: ", why));
}

void CallSecurity::EndCall(const Caller& caller) {
  // Without a serial it was made within this process.
  if (conduct_ != nullptr && !caller.peer.serial.empty()) conduct_->EndCall(caller.peer.uri);
}

void CallSecurity::NoteMessage(const Caller& caller, size_t bytes) {
  if (connections_ != nullptr && !caller.address.empty()) {
    connections_->Explain(caller.address, bytes + kMessageOverheadBytes);
  }
}

absl::Status CallSecurity::Authorise(const grpc::AuthContext& context, std::string_view method) {
  const absl::StatusOr<Peer> peer = IdentifyFrom(context);
  absl::Status status = peer.ok() ? CheckAccess(*peer, method) : peer.status();
  if (status.ok()) {
    status = BeginCall(*peer);
    // The log has a line for the whole flood, and the clients hear of it.
    if (!status.ok()) return status;
  }
  if (!status.ok()) {
    audit_.Write("call_refused", peer.ok() ? Describe(*peer) : "",
                 {{"method", std::string(method)}, {"reason", std::string(status.message())}});
  }
  return status;
}

absl::Status CallSecurity::CheckPeer(const Peer& peer, std::string_view method) {
  const absl::Status status = CheckAccess(peer, method);
  if (!status.ok()) {
    audit_.Write("call_refused", Describe(peer),
                 {{"method", std::string(method)}, {"reason", std::string(status.message())}});
  }
  return status;
}

void CallSecurity::AddCaller(const Caller& caller, grpc::ClientContext* context) const {
  if (key_.empty()) return;
  context->AddMetadata(kKey, key_);
  context->AddMetadata(kAddress, caller.address);
  if (!caller.peer.has_certificate) return;
  context->AddMetadata(kRole, std::string(RoleName(caller.peer.role)));
  context->AddMetadata(kName, caller.peer.name);
}

bool CallSecurity::ReadCaller(const grpc::ServerContextBase& context, Caller* caller) const {
  if (key_.empty() || MetadataOf(context, kKey) != key_) return false;
  caller->address = MetadataOf(context, kAddress);
  const std::optional<Role> role = RoleFromName(MetadataOf(context, kRole));
  if (role) {
    caller->peer = {.has_certificate = true, .role = *role, .name = MetadataOf(context, kName)};
    caller->peer.uri = PeerUri(*role, caller->peer.name);
  }
  return true;
}

Caller CallSecurity::CallerOf(const grpc::ServerContextBase& context) {
  Caller caller{.peer = {}, .address = AddressOfUri(context.peer())};
  if (ReadCaller(context, &caller)) return caller;
  if (identity_ == nullptr) return caller;
  const std::shared_ptr<const grpc::AuthContext> authentication = context.auth_context();
  if (authentication == nullptr) return caller;
  if (absl::StatusOr<Peer> peer = IdentifyFrom(*authentication); peer.ok()) {
    caller.peer = *std::move(peer);
  } else {
    // Revoked or at its end since the call was authorised a moment ago: nobody's, who may nothing.
    caller.peer = {.has_certificate = true, .role = Role::kViewer};
  }
  if (connections_ != nullptr && caller.peer.has_certificate && !caller.address.empty()) {
    connections_->SetPeer(caller.address, caller.peer);
  }
  return caller;
}

}  // namespace rigcal::server
