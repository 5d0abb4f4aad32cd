// SPDX-License-Identifier: Apache-2.0
#include "common/identity/openssl_handles.h"

#include <openssl/err.h>
#include <openssl/pem.h>

#include <array>

#include "absl/strings/str_cat.h"

namespace rigcal::openssl {
namespace {

// An encrypted key must not ask for its password on the terminal.
int NoPassword(char*, int, int, void*) { return -1; }

}  // namespace

absl::Status Error(std::string_view what) {
  std::array<char, 256> reason{};
  const unsigned long code = ERR_peek_last_error();
  if (code != 0) ERR_error_string_n(code, reason.data(), reason.size());
  ERR_clear_error();
  return absl::InternalError(absl::StrCat("cannot ", std::string(what), ": ",
                                          code == 0 ? "OpenSSL gives no reason" : reason.data()));
}

BioPtr ReadBio(std::string_view text) {
  return BioPtr(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

BioPtr WriteBio() { return BioPtr(BIO_new(BIO_s_mem())); }

std::string TextOf(const BioPtr& bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &data);
  return size <= 0 ? "" : std::string(data, static_cast<size_t>(size));
}

CertificatePtr CertificateFromPem(std::string_view pem) {
  CertificatePtr certificate(PEM_read_bio_X509(ReadBio(pem).get(), nullptr, NoPassword, nullptr));
  ERR_clear_error();
  return certificate;
}

std::vector<CertificatePtr> CertificatesFromPem(std::string_view pem) {
  const BioPtr bio = ReadBio(pem);
  std::vector<CertificatePtr> certificates;
  while (X509* const next = PEM_read_bio_X509(bio.get(), nullptr, NoPassword, nullptr)) {
    certificates.emplace_back(next);
  }
  ERR_clear_error();
  return certificates;
}

KeyPtr PrivateKeyFromPem(std::string_view pem) {
  KeyPtr key(PEM_read_bio_PrivateKey(ReadBio(pem).get(), nullptr, NoPassword, nullptr));
  ERR_clear_error();
  return key;
}

RequestPtr RequestFromPem(std::string_view pem) {
  RequestPtr request(PEM_read_bio_X509_REQ(ReadBio(pem).get(), nullptr, NoPassword, nullptr));
  ERR_clear_error();
  return request;
}

bool IsP256(const EVP_PKEY* key) {
  if (key == nullptr || EVP_PKEY_get_base_id(key) != EVP_PKEY_EC) return false;
  std::array<char, 64> group{};
  size_t size = 0;
  if (EVP_PKEY_get_group_name(key, group.data(), group.size(), &size) != 1) return false;
  return std::string_view(group.data(), size) == "prime256v1";
}

std::string SubjectEntry(const X509_NAME* subject, int nid) {
  const int index = X509_NAME_get_index_by_NID(subject, nid, -1);
  if (index < 0 || X509_NAME_get_index_by_NID(subject, nid, index) >= 0) return "";
  const ASN1_STRING* const entry = X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, index));
  unsigned char* text = nullptr;
  const int size = ASN1_STRING_to_UTF8(&text, entry);
  if (size < 0) {
    ERR_clear_error();
    return "";
  }
  std::string result(reinterpret_cast<const char*>(text), static_cast<size_t>(size));
  OPENSSL_free(text);
  return result;
}

}  // namespace rigcal::openssl
