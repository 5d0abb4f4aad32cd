// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "absl/time/time.h"
#include "common/identity/certificate.h"
#include "server/identity/certificate_authority.h"
#include "server/identity/denied_certificates.h"
#include "server/identity/identity_registry.h"

namespace rigcal::testing {

// A certificate that the server with this identity folder gave out at this time, as a renewal of
// the one that its owner has. It is on record in the files; a server that runs does not know it
// itself, and writes the file without it when it next gives out another.
inline std::string IssuedBefore(const std::filesystem::path& folder,
                                const server::CertificateAuthority::PeerRequest& request,
                                absl::Time time) {
  const auto ca = server::CertificateAuthority::Open(folder);
  std::string pem = *ca->IssuePeer(request, time);
  const Certificate certificate = *ParseCertificate(pem);
  auto registry = server::IdentityRegistry::Open(folder / "identities.json");
  if (!registry.ok() || !registry->Record(certificate, /*joins=*/false, time).ok()) return "";
  server::DeniedCertificates denied(folder / "denied.json");
  return denied.Accept(certificate.uri, certificate.serial).ok() ? pem : "";
}

}  // namespace rigcal::testing
