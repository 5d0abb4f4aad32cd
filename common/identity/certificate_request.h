// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/identity/role.h"

namespace rigcal {

// A request for a certificate (CSR, PKCS 10) as PEM, signed with the key (PEM).
absl::StatusOr<std::string> MakeCertificateRequest(std::string_view key_pem, std::string_view name,
                                                   Role role);

// What a request asks for; its sender has the private key.
struct CertificateRequest {
  std::string name;        // CN
  std::string role;        // OU, as written
  std::string public_key;  // DER (SubjectPublicKeyInfo); on P-256
};

// INVALID_ARGUMENT: not a request as PEM, its key is missing or not on P-256, or it is not signed
// with that key.
absl::StatusOr<CertificateRequest> ParseCertificateRequest(std::string_view pem);

// The public key (DER) of a certificate (PEM); empty: it cannot be read.
std::string PublicKeyOf(std::string_view certificate_pem);

}  // namespace rigcal
