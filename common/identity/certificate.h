// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/identity/role.h"

namespace rigcal {

// What rigcal reads in a certificate. Only CheckIssuedBy makes it true.
struct Certificate {
  std::string pem = {};
  std::string name = {};          // CN of the subject
  std::optional<Role> role = {};  // OU of the subject; unset for the server and the CA
  std::string uri = {};  // its one URI: rigcal://agents/NAME; empty: it has none or several
  // DNS names and IP addresses as text; of servers.
  std::vector<std::string> hosts = {};
  std::string serial = {};  // hexadecimal, lower case, without leading zeros
  std::string sha256 = {};  // of its DER form, 32 bytes
  absl::Time not_before = {};
  absl::Time not_after = {};
};

// INVALID_ARGUMENT: not a certificate as PEM.
absl::StatusOr<Certificate> ParseCertificate(std::string_view pem);

// What a certificate is used for, which its "extended key usage" must allow.
enum class CertificateUse : uint8_t { kServer, kClient };

// OK if the CA has signed the certificate for this use. Times are not looked at: whose clock is
// right is the caller's to judge. UNAUTHENTICATED: it is not; the message says why.
absl::Status CheckIssuedBy(const Certificate& certificate, std::string_view ca_pem,
                           CertificateUse use);

}  // namespace rigcal
