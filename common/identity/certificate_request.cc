// SPDX-License-Identifier: Apache-2.0
#include "common/identity/certificate_request.h"

#include <openssl/err.h>
#include <openssl/pem.h>

#include "common/identity/openssl_handles.h"

namespace rigcal {
namespace {

bool AddEntry(X509_NAME* subject, int nid, std::string_view text) {
  return X509_NAME_add_entry_by_NID(subject, nid, MBSTRING_UTF8,
                                    reinterpret_cast<const unsigned char*>(text.data()),
                                    static_cast<int>(text.size()), -1, 0) == 1;
}

std::string PublicKeyDer(EVP_PKEY* key) {
  unsigned char* bytes = nullptr;
  const int size = i2d_PUBKEY(key, &bytes);
  if (size < 0) return "";
  std::string der(reinterpret_cast<const char*>(bytes), static_cast<size_t>(size));
  OPENSSL_free(bytes);
  return der;
}

}  // namespace

absl::StatusOr<std::string> MakeCertificateRequest(std::string_view key_pem, std::string_view name,
                                                   Role role) {
  const openssl::KeyPtr key = openssl::PrivateKeyFromPem(key_pem);
  if (!key) return absl::InvalidArgumentError("the private key cannot be read");
  const openssl::RequestPtr request(X509_REQ_new());
  const openssl::BioPtr out = openssl::WriteBio();
  X509_NAME* const subject = request ? X509_REQ_get_subject_name(request.get()) : nullptr;
  if (subject == nullptr || !AddEntry(subject, NID_commonName, name) ||
      !AddEntry(subject, NID_organizationalUnitName, RoleName(role)) ||
      X509_REQ_set_pubkey(request.get(), key.get()) != 1 ||
      X509_REQ_sign(request.get(), key.get(), EVP_sha256()) <= 0 ||
      PEM_write_bio_X509_REQ(out.get(), request.get()) != 1) {
    return openssl::Error("make a certificate request");
  }
  return openssl::TextOf(out);
}

absl::StatusOr<CertificateRequest> ParseCertificateRequest(std::string_view pem) {
  const openssl::RequestPtr request = openssl::RequestFromPem(pem);
  if (!request) {
    return absl::InvalidArgumentError("the certificate request is not one in PEM form");
  }
  EVP_PKEY* const key = X509_REQ_get0_pubkey(request.get());
  if (!openssl::IsP256(key)) {
    ERR_clear_error();
    return absl::InvalidArgumentError(
        "the certificate request has no key on the curve P-256; make it with rigcal-agent join or "
        "rigcal login");
  }
  const bool signed_by_key = X509_REQ_verify(request.get(), key) == 1;
  ERR_clear_error();
  if (!signed_by_key) {
    return absl::InvalidArgumentError(
        "the certificate request is not signed with its own key, so its sender need not have it");
  }
  const X509_NAME* const subject = X509_REQ_get_subject_name(request.get());
  return CertificateRequest{.name = openssl::SubjectEntry(subject, NID_commonName),
                            .role = openssl::SubjectEntry(subject, NID_organizationalUnitName),
                            .public_key = PublicKeyDer(key)};
}

std::string PublicKeyOf(std::string_view certificate_pem) {
  const openssl::CertificatePtr certificate = openssl::CertificateFromPem(certificate_pem);
  EVP_PKEY* const key = certificate ? X509_get0_pubkey(certificate.get()) : nullptr;
  return key == nullptr ? "" : PublicKeyDer(key);
}

}  // namespace rigcal
