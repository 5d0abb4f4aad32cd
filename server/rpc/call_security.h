// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/client_context.h>
#include <grpcpp/security/auth_context.h>
#include <grpcpp/server_context.h>

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/checked_identity.h"
#include "server/access/peer.h"
#include "server/access/peer_conduct.h"
#include "server/audit/audit_log.h"
#include "server/identity/accepted_certificates.h"
#include "server/listen/connections.h"

namespace rigcal::server {

// What the headers of a call take, once HPACK has what most of them share.
inline constexpr size_t kCallHeaderBytes = 512;

// Who makes a call, and from where.
struct Caller {
  Peer peer;
  std::string address;  // "10.0.0.5:41002"; empty: over the socket file, or in the process

  // The caller as the audit log names him: "operator 'anna'"; empty: somebody on this PC.
  std::string OperatorName() const { return peer.has_certificate ? Describe(peer) : ""; }
};

// Tells who calls, and whether they may. Every connection and every call goes through here. Without
// an identity there are no certificates, and all callers are on this machine. Thread-safe.
class CallSecurity {
 public:
  // All must outlive this object; `identity`, `accepted` and `conduct` may be null together.
  CallSecurity(const CheckedIdentity* identity, AcceptedCertificates* accepted,
               Connections* connections, PeerConduct* conduct, AuditLog* audit);

  // UNAUTHENTICATED: the CA has not signed the certificate, it is not valid now, or of another
  // form. PERMISSION_DENIED: it was revoked, or is not on record.
  absl::StatusOr<Peer> Identify(std::string_view certificate_pem);
  // As Identify, at the end of a TLS handshake. RESOURCE_EXHAUSTED: the peer is kept out for a
  // while, because it has flooded the server.
  absl::StatusOr<Peer> Welcome(std::string_view certificate_pem);
  // As Identify, of the other end of a connection, and whether it may call `method`. What is
  // refused gets a line in the audit log. Each call that is let in is ended by EndCall.
  // RESOURCE_EXHAUSTED: the peer has too many unfinished calls; its connections are cut.
  absl::Status Authorise(const grpc::AuthContext& context, std::string_view method);
  // Who makes this call, which has been authorised. Also notes whose the connection is.
  Caller CallerOf(const grpc::ServerContextBase& context);

  // A call of `caller` is over, whatever became of it.
  void EndCall(const Caller& caller);
  // A service has got a message of this size from `caller`.
  void NoteMessage(const Caller& caller, size_t bytes);

  // Whether a peer that was identified elsewhere may call `method`, with a line as above if not.
  absl::Status CheckPeer(const Peer& peer, std::string_view method);
  // Names the caller of a call that is made within this process for somebody else, so that CallerOf
  // tells him. Only this object can do so: a key that it made goes with it.
  void AddCaller(const Caller& caller, grpc::ClientContext* context) const;

  // Why an open connection of this peer must end: "its certificate was revoked". Empty: it need
  // not. Every peer with a certificate must go while it is not known whom the lists name.
  std::string WhyToCut(const Peer& peer);
  bool has_certificates() const { return identity_ != nullptr; }
  AuditLog& audit() { return audit_; }

 private:
  absl::StatusOr<Peer> IdentifyFrom(const grpc::AuthContext& context);
  absl::Status BeginCall(const Peer& peer);
  absl::Status CheckConduct(const Peer& peer, PeerConduct::Clock::time_point now);
  // True: the call was made within this process, for `caller`.
  bool ReadCaller(const grpc::ServerContextBase& context, Caller* caller) const;

  const CheckedIdentity* const identity_;
  AcceptedCertificates* const accepted_;
  Connections* const connections_;
  PeerConduct* const conduct_;
  AuditLog& audit_;
  const std::string key_;  // of calls within the process; never leaves it
  // Certificates that were read and are signed by this CA.
  std::mutex mutex_;
  std::shared_ptr<const TrustedCa> known_by_;
  std::map<std::string, Peer, std::less<>> known_;
};

// "ipv4:10.0.0.5:41002" or "ipv6:%5B::1%5D:41002", as gRPC writes it, as AddressText does.
std::string AddressOfUri(std::string_view uri);

}  // namespace rigcal::server
