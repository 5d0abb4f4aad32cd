// SPDX-License-Identifier: Apache-2.0
// Certificates and requests for them, as anybody may send them to the enrolment port.
#include "common/identity/certificate_request.h"

#include <string_view>

#include "common/identity/certificate.h"
#include "tests/fuzz/fuzz_check.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto request = rigcal::ParseCertificateRequest(text); request.ok()) {
    FUZZ_CHECK(!request->public_key.empty());
  } else {
    FUZZ_CHECK(request.status().code() == absl::StatusCode::kInvalidArgument);
  }
  if (const auto certificate = rigcal::ParseCertificate(text); certificate.ok()) {
    FUZZ_CHECK(certificate->sha256.size() == 32 && !certificate->serial.empty());
    // It is its own CA at most, and never crashes the check.
    (void)rigcal::CheckIssuedBy(*certificate, text, rigcal::CertificateUse::kClient).ok();
    (void)rigcal::PublicKeyOf(text).size();
  }
  return 0;
}
