// SPDX-License-Identifier: Apache-2.0
#include "common/identity/signature.h"

#include <openssl/err.h>

#include "common/identity/openssl_handles.h"

namespace rigcal {
namespace {

const unsigned char* Bytes(std::string_view text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

}  // namespace

absl::StatusOr<std::string> Sign(std::string_view key_pem, std::string_view bytes) {
  const openssl::KeyPtr key = openssl::PrivateKeyFromPem(key_pem);
  if (!key) return openssl::Error("read a private key");
  const openssl::DigestContextPtr context(EVP_MD_CTX_new());
  size_t size = 0;
  if (EVP_DigestSignInit(context.get(), nullptr, EVP_sha256(), nullptr, key.get()) != 1 ||
      EVP_DigestSign(context.get(), nullptr, &size, Bytes(bytes), bytes.size()) != 1) {
    return openssl::Error("sign");
  }
  std::string signature(size, '\0');
  if (EVP_DigestSign(context.get(), reinterpret_cast<unsigned char*>(signature.data()), &size,
                     Bytes(bytes), bytes.size()) != 1) {
    return openssl::Error("sign");
  }
  signature.resize(size);
  return signature;
}

absl::Status CheckSignature(std::string_view certificates_pem, std::string_view bytes,
                            std::string_view signature) {
  for (const openssl::CertificatePtr& certificate :
       openssl::CertificatesFromPem(certificates_pem)) {
    EVP_PKEY* const key = X509_get0_pubkey(certificate.get());
    const openssl::DigestContextPtr context(EVP_MD_CTX_new());
    if (key != nullptr &&
        EVP_DigestVerifyInit(context.get(), nullptr, EVP_sha256(), nullptr, key) == 1 &&
        EVP_DigestVerify(context.get(), Bytes(signature), signature.size(), Bytes(bytes),
                         bytes.size()) == 1) {
      return absl::OkStatus();
    }
  }
  ERR_clear_error();
  return absl::UnauthenticatedError("the signature is not that of the certificate authority");
}

}  // namespace rigcal
