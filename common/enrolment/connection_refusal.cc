// SPDX-License-Identifier: Apache-2.0
#include "common/enrolment/connection_refusal.h"

#include <optional>

#include "absl/strings/str_cat.h"
#include "common/enrolment/join_server.h"
#include "common/enrolment/tls_probe.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

// What one gRPC port has to say against the identity.
absl::Status FaultAt(const std::string& address, const TlsProbe& probe,
                     const std::string& certificate) {
  switch (probe.fault) {
    case TlsFault::kOtherCa:
      return absl::UnauthenticatedError(
          absl::StrCat("the server at ", address,
                       " is not the one that was joined: its certificate is of another CA. If the "
                       "server was set up anew, join again; else somebody else answers there"));
    case TlsFault::kExpired:
    case TlsFault::kNotYetValid:
      return absl::FailedPreconditionError(absl::StrCat(
          "the certificate of the server at ", address, " is not valid by the clock of this PC (",
          probe.detail, "); compare the clocks of both PCs"));
    case TlsFault::kClientRefused:
      return absl::PermissionDeniedError(absl::StrCat(
          "the server at ", address, " closes the connection when it has seen ", certificate,
          ": it was revoked, has ended, or is not on record there. Its HTTPS port, which says "
          "which, does not answer; join again with a new join string"));
    default:
      return absl::OkStatus();
  }
}

}  // namespace

absl::Status ExplainRefusal(const IdentityFolder& folder, std::chrono::milliseconds timeout) {
  RIGCAL_ASSIGN_OR_RETURN(const PeerIdentity identity, folder.Load());
  const absl::StatusOr<std::optional<PeerIdentity>> answer = RenewIdentity(identity, timeout);
  if (answer.ok() && answer->has_value()) {
    RIGCAL_RETURN_IF_ERROR(folder.Renew(**answer));
    return absl::AbortedError("the certificate had ended and was renewed just now; try again");
  }
  if (answer.ok()) folder.NoteAsked();
  return absl::IsUnavailable(answer.status()) ? TryHandshakes(identity, timeout) : answer.status();
}

absl::Status TryHandshakes(const PeerIdentity& identity, std::chrono::milliseconds timeout) {
  RIGCAL_ASSIGN_OR_RETURN(const Certificate own, ParseCertificate(identity.certificate_pem));
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  for (const std::string& address : identity.grpc) {
    if (std::chrono::steady_clock::now() >= deadline) break;
    RIGCAL_RETURN_IF_ERROR(FaultAt(address, ProbeTls(address, &identity, timeout), Describe(own)));
  }
  return absl::OkStatus();
}

}  // namespace rigcal
