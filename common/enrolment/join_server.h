// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "common/identity/identity_folder.h"
#include "common/identity/join_string.h"

namespace rigcal {

// Joins the server of a join string under `name`: fetches the CA, compares its hash with the
// string's, verifies the server with that CA, and only then sends the secret and a certificate
// request. The hosts are tried in their order.
//   UNAVAILABLE          no host answers; each is named with the reason
//   FAILED_PRECONDITION  the server is another one than the string was made by
//   UNAUTHENTICATED      a server shows the right CA and cannot prove to be its server
//   others               the server's own refusal, such as PERMISSION_DENIED for a used string
absl::StatusOr<PeerIdentity> JoinServer(
    const JoinString& join, const std::string& name,
    std::chrono::milliseconds timeout = std::chrono::milliseconds(10'000));

// By this PC's clock the certificate has passed two thirds of its life, or has not begun. Only the
// server knows what is due: it is asked in any case, and then at once.
bool IsRenewalDue(const PeerIdentity& identity, absl::Time now = absl::Now());

// Asks the servers of the identity for a newer certificate. Unset: they consider it too early. The
// errors of JoinServer; PERMISSION_DENIED: it was revoked.
absl::StatusOr<std::optional<PeerIdentity>> RenewIdentity(
    const PeerIdentity& identity,
    std::chrono::milliseconds timeout = std::chrono::milliseconds(10'000));

// For programs that run for a moment: keeps the certificate in a folder. Its servers are asked
// where it seems due, and once a day in any case, since this PC's clock may be wrong. OK: what is
// in the folder is the newest, as far as can be told. Errors as those of RenewIdentity.
absl::Status KeepRenewed(const IdentityFolder& folder,
                         std::chrono::milliseconds timeout = std::chrono::milliseconds(10'000));

}  // namespace rigcal
