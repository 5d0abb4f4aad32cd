// SPDX-License-Identifier: Apache-2.0
#include "server/access/trusted_ca.h"

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/identity/certificate.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"

namespace rigcal::server {

absl::StatusOr<TrustedCa> TrustedCa::Parse(std::string pem) {
  RIGCAL_RETURN_IF_ERROR(CheckCaCertificates(pem));
  return TrustedCa(std::move(pem));
}

absl::StatusOr<Peer> TrustedCa::Identify(std::string_view pem, absl::Time now) const {
  const absl::StatusOr<Certificate> certificate = ParseCertificate(pem);
  if (!certificate.ok()) {
    return absl::UnauthenticatedError("the client's certificate cannot be read");
  }
  RIGCAL_RETURN_IF_ERROR(CheckIssuedBy(*certificate, pem_, CertificateUse::kClient, now));
  const auto refused = [&](const std::string& why) {
    return absl::UnauthenticatedError(absl::StrCat(Describe(*certificate), " is refused: ", why));
  };
  const std::string& uri = certificate->uri;
  if (uri.empty()) return refused("it must have exactly one URI, who it is");
  const std::string agents = PeerUri(Role::kAgent, "");
  const std::string users = PeerUri(Role::kViewer, "");
  const bool is_agent = uri.starts_with(agents);
  if (!is_agent && !uri.starts_with(users)) {
    return refused("its URI is neither that of an agent nor that of a user");
  }
  const std::string name = uri.substr(is_agent ? agents.size() : users.size());
  if (!ValidateName("", name).ok()) return refused("the name in its URI is not valid");
  if (!certificate->role || is_agent != (*certificate->role == Role::kAgent)) {
    return refused(absl::StrCat("its role '", absl::CHexEscape(certificate->unit.substr(0, 32)),
                                "' does not go with ", uri));
  }
  return Peer{.has_certificate = true,
              .role = *certificate->role,
              .name = name,
              .uri = uri,
              .serial = certificate->serial,
              .not_after_utc_s = absl::ToUnixSeconds(certificate->not_after)};
}

absl::StatusOr<absl::Time> TrustedCa::CheckServerCertificate(std::string_view certificate_pem,
                                                             std::string_view key_pem,
                                                             absl::Time now) const {
  RIGCAL_RETURN_IF_ERROR(
      CheckKeyOf(certificate_pem, key_pem, "the certificate and the private key"));
  RIGCAL_ASSIGN_OR_RETURN(const Certificate certificate, ParseCertificate(certificate_pem));
  RIGCAL_RETURN_IF_ERROR(CheckIssuedBy(certificate, pem_, CertificateUse::kServer, now));
  return certificate.not_after;
}

}  // namespace rigcal::server
