// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

// A signature over any bytes by a private key (PEM), with SHA-256; of P-256 keys ECDSA in DER form.
// INTERNAL: OpenSSL's reason.
absl::StatusOr<std::string> Sign(std::string_view key_pem, std::string_view bytes);

// UNAUTHENTICATED: the key of no certificate in the text (PEM, one or several) has made the
// signature over these bytes.
absl::Status CheckSignature(std::string_view certificates_pem, std::string_view bytes,
                            std::string_view signature);

}  // namespace rigcal
