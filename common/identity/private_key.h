// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

// A new private key on the curve P-256, as PEM (PKCS 8, not encrypted).
absl::StatusOr<std::string> MakePrivateKey();

// FAILED_PRECONDITION unless the key (PEM) is that of the certificate (PEM); `what` names the two
// in the message: "agent.key and agent.crt".
absl::Status CheckKeyOf(std::string_view certificate_pem, std::string_view key_pem,
                        std::string_view what);

// SHA-256 of any bytes, 32 bytes.
std::string Sha256(std::string_view bytes);
// `count` bytes that nobody can guess.
absl::StatusOr<std::string> RandomBytes(size_t count);

}  // namespace rigcal
