// SPDX-License-Identifier: Apache-2.0
#include "common/identity/private_key.h"

#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/sha.h>

#include "absl/strings/str_cat.h"
#include "common/identity/openssl_handles.h"

namespace rigcal {

absl::StatusOr<std::string> MakePrivateKey() {
  const openssl::KeyPtr key(EVP_EC_gen("P-256"));
  if (!key) return openssl::Error("make a private key");
  const openssl::BioPtr out = openssl::WriteBio();
  if (PEM_write_bio_PKCS8PrivateKey(out.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr) !=
      1) {
    return openssl::Error("write a private key");
  }
  return openssl::TextOf(out);
}

absl::Status CheckKeyOf(std::string_view certificate_pem, std::string_view key_pem,
                        std::string_view what) {
  const openssl::CertificatePtr certificate = openssl::CertificateFromPem(certificate_pem);
  const openssl::KeyPtr key = openssl::PrivateKeyFromPem(key_pem);
  if (certificate && key && EVP_PKEY_eq(X509_get0_pubkey(certificate.get()), key.get()) == 1) {
    return absl::OkStatus();
  }
  const char* const problem = !certificate ? ": the certificate cannot be read"
                              : !key       ? ": the key cannot be read"
                                           : " do not belong together";
  return absl::FailedPreconditionError(absl::StrCat(std::string(what), problem));
}

std::string Sha256(std::string_view bytes) {
  std::string digest(SHA256_DIGEST_LENGTH, '\0');
  SHA256(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(),
         reinterpret_cast<unsigned char*>(digest.data()));
  return digest;
}

absl::StatusOr<std::string> RandomBytes(size_t count) {
  std::string bytes(count, '\0');
  if (RAND_bytes(reinterpret_cast<unsigned char*>(bytes.data()), static_cast<int>(count)) != 1) {
    return openssl::Error("make random bytes");
  }
  return bytes;
}

}  // namespace rigcal
