// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>

#include "absl/status/status.h"
#include "common/identity/identity_folder.h"

namespace rigcal {

// Why servers do not let an identity in, where a connection to their gRPC port fails: a server that
// refuses a certificate closes the connection without a word. The HTTPS port is asked, which says
// it to the holder of the certificate's key; where that does not answer, the TLS handshake of the
// gRPC port tells some of it. A certificate that the server renews instead is put into the folder.
//   OK                   nothing speaks against the identity: the server may just not be there
//   ABORTED              the certificate was renewed just now: connect again
//   PERMISSION_DENIED    the certificate was revoked, or the server does not take it
//   UNAUTHENTICATED      it has ended long ago, or another server answers there
//   FAILED_PRECONDITION  the folder cannot be used, or the clock of this PC is years off
absl::Status ExplainRefusal(const IdentityFolder& folder, std::chrono::milliseconds timeout);

// What the handshakes of the gRPC ports alone tell of it; the errors of ExplainRefusal. None begins
// after `timeout`.
absl::Status TryHandshakes(const PeerIdentity& identity, std::chrono::milliseconds timeout);

}  // namespace rigcal
