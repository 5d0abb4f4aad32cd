// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/access/peer.h"

namespace rigcal::server {

// The certificate authority whose certificates this server takes. Thread-safe.
class TrustedCa {
 public:
  // Reads a PEM text with one CA or several. INVALID_ARGUMENT: it holds none.
  static absl::StatusOr<TrustedCa> Parse(std::string pem);

  // Reads who owns a client's certificate (PEM): a URI in its SAN, rigcal://agents/NAME or
  // rigcal://users/NAME, and the role in the OU of its subject.
  // UNAUTHENTICATED: not signed by this CA, not valid now, or of another form; the message names
  // the certificate and says what is wrong with it.
  absl::StatusOr<Peer> Identify(std::string_view pem, absl::Time now) const;

  // The end of a server's certificate: this CA has signed it, it is valid now, and `key_pem` is its
  // private key. Else the error says what is wrong.
  absl::StatusOr<absl::Time> CheckServerCertificate(std::string_view certificate_pem,
                                                    std::string_view key_pem, absl::Time now) const;

 private:
  explicit TrustedCa(std::string pem) : pem_(std::move(pem)) {}

  std::string pem_;
};

}  // namespace rigcal::server
