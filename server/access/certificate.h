// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/peer.h"

namespace rigcal::server {

// The certificate authority whose certificates this server takes. Thread-safe.
class TrustedCa {
 public:
  // Reads a PEM text with one CA or several. INVALID_ARGUMENT: it holds none.
  static absl::StatusOr<TrustedCa> Parse(std::string_view pem);

  // Reads who owns a client's certificate (PEM): a URI in its SAN, rigcal://agents/NAME or
  // rigcal://users/NAME, and the role in the OU of its subject.
  // UNAUTHENTICATED: not signed by this CA, not valid now, or of another form; the message names
  // the certificate and says what is wrong with it.
  absl::StatusOr<Peer> Identify(std::string_view pem, int64_t now_utc_s) const;

  // OK: this CA has signed `certificate_pem`, it is valid now, and `key_pem` is its private key.
  // INVALID_ARGUMENT says what is wrong.
  absl::Status CheckServerCertificate(std::string_view certificate_pem, std::string_view key_pem,
                                      int64_t now_utc_s) const;

 private:
  std::shared_ptr<void> store_;  // an X509_STORE
};

// The end of a certificate's life, UTC. INVALID_ARGUMENT: not a certificate.
absl::StatusOr<int64_t> CertificateEndUtcS(std::string_view pem);

}  // namespace rigcal::server
