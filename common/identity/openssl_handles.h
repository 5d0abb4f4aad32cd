// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"

namespace rigcal::openssl {

// Owners of OpenSSL's objects.
template <auto Free>
struct Deleter {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};
using BioPtr = std::unique_ptr<BIO, Deleter<BIO_free_all>>;
using CertificatePtr = std::unique_ptr<X509, Deleter<X509_free>>;
using DigestContextPtr = std::unique_ptr<EVP_MD_CTX, Deleter<EVP_MD_CTX_free>>;
using ExtensionPtr = std::unique_ptr<X509_EXTENSION, Deleter<X509_EXTENSION_free>>;
using KeyPtr = std::unique_ptr<EVP_PKEY, Deleter<EVP_PKEY_free>>;
using NumberPtr = std::unique_ptr<BIGNUM, Deleter<BN_free>>;
using RequestPtr = std::unique_ptr<X509_REQ, Deleter<X509_REQ_free>>;
using StorePtr = std::unique_ptr<X509_STORE, Deleter<X509_STORE_free>>;
using StoreContextPtr = std::unique_ptr<X509_STORE_CTX, Deleter<X509_STORE_CTX_free>>;
using NamesPtr = std::unique_ptr<GENERAL_NAMES, Deleter<GENERAL_NAMES_free>>;

// INTERNAL: "cannot WHAT: " and the library's reason. Empties its queue of errors.
absl::Status Error(std::string_view what);

// Reads text through a BIO; `text` outlives it.
BioPtr ReadBio(std::string_view text);
BioPtr WriteBio();
std::string TextOf(const BioPtr& bio);

// Null: not PEM, or another kind of object. Empties the queue of errors.
CertificatePtr CertificateFromPem(std::string_view pem);
// All that follow each other in the text, until one cannot be read.
std::vector<CertificatePtr> CertificatesFromPem(std::string_view pem);
KeyPtr PrivateKeyFromPem(std::string_view pem);
RequestPtr RequestFromPem(std::string_view pem);

bool IsP256(const EVP_PKEY* key);
// The text of an entry of a subject (NID_commonName); empty: it has none or several.
std::string SubjectEntry(const X509_NAME* subject, int nid);

}  // namespace rigcal::openssl
