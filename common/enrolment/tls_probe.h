// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "common/identity/certificate.h"
#include "common/identity/identity_folder.h"

namespace rigcal {

// Why a TLS connection to a gRPC port fails; the gRPC client says "Socket closed" to most of it.
enum class TlsFault {
  kNone,
  kUnknownHost,    // the name has no address
  kPortClosed,     // the host answers, and refuses the connection
  kNoAnswer,       // nothing comes back: no such host, or a firewall
  kPlaintext,      // a server without TLS
  kOtherCa,        // the server's certificate is of another CA
  kWrongName,      // ... is for other names and addresses
  kExpired,        // ... has ended, by the clock of this PC
  kNotYetValid,    // ... has not begun, by the clock of this PC
  kClientRefused,  // the server does not take this PC's certificate, or wants one
  kBroken,         // anything else
};

struct TlsProbe {
  TlsFault fault = TlsFault::kNone;
  std::string detail = {};                 // the words of the system or of OpenSSL
  std::optional<Certificate> server = {};  // what it showed
};

// Connects to HOST:PORT as a gRPC client would, with the identity's certificate if there is one,
// and waits for the first bytes of the server. Without an identity no CA is trusted, and the
// server's certificate is only shown.
TlsProbe ProbeTls(const std::string& address, const PeerIdentity* identity,
                  std::chrono::milliseconds timeout);

}  // namespace rigcal
