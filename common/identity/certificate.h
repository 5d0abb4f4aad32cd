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
  std::string unit = {};          // OU of the subject, as written
  std::optional<Role> role = {};  // what `unit` says; unset for the server and the CA
  std::string uri = {};  // its one URI: rigcal://agents/NAME; empty: it has none or several
  // DNS names and IP addresses as text; of servers.
  std::vector<std::string> hosts = {};
  std::string serial = {};  // hexadecimal, lower case, without leading zeros
  std::string sha256 = {};  // of its DER form, 32 bytes
  absl::Time not_before = {};
  absl::Time not_after = {};
};

// The first in the text. INVALID_ARGUMENT: not a certificate as PEM.
absl::StatusOr<Certificate> ParseCertificate(std::string_view pem);

// The one certificate that a text holds, its `pem` written anew: libraries trust every certificate
// in a text that they are given, so none may come along unseen.
// INVALID_ARGUMENT: the text holds none, a second PEM block, or anything else beside it; the
// message says which: "holds 2 PEM blocks where one certificate is expected".
absl::StatusOr<Certificate> ParseOnlyCertificate(std::string_view pem);
// The same for a file that a person may have put there: text around its one block is left out.
absl::StatusOr<Certificate> ParseCertificateFile(std::string_view text);

// What a certificate is used for, which its "extended key usage" must allow.
enum class CertificateUse : uint8_t { kServer, kClient };

// OK if the CA, or one of several in the text, has signed the certificate for this use. Whether it
// is valid at `time` is looked at where there is one: else it is the caller's to judge whose clock
// is right. UNAUTHENTICATED: it is not; the message names the certificate, and says why and what to
// do.
absl::Status CheckIssuedBy(const Certificate& certificate, std::string_view ca_pem,
                           CertificateUse use, std::optional<absl::Time> time = {});

// INVALID_ARGUMENT: the text (PEM) holds no certificate, or one that is not a CA's.
absl::Status CheckCaCertificates(std::string_view pem);

// "certificate 3fa2 of 'pc1'": what it says of itself, escaped, for messages.
std::string Describe(const Certificate& certificate);

}  // namespace rigcal
