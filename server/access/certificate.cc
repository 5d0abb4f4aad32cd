// SPDX-License-Identifier: Apache-2.0
#include "server/access/certificate.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509_vfy.h>
#include <openssl/x509v3.h>

#include <ctime>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"

namespace rigcal::server {
namespace {

template <typename T, void (*Free)(T*)>
struct Deleter {
  void operator()(T* pointer) const { Free(pointer); }
};
using X509Pointer = std::unique_ptr<X509, Deleter<X509, X509_free>>;
using KeyPointer = std::unique_ptr<EVP_PKEY, Deleter<EVP_PKEY, EVP_PKEY_free>>;
using ContextPointer =
    std::unique_ptr<X509_STORE_CTX, Deleter<X509_STORE_CTX, X509_STORE_CTX_free>>;
struct BioDeleter {
  void operator()(BIO* bio) const { BIO_free(bio); }
};
using BioPointer = std::unique_ptr<BIO, BioDeleter>;

constexpr std::string_view kAgentUri = "rigcal://agents/";
constexpr std::string_view kUserUri = "rigcal://users/";

BioPointer Memory(std::string_view text) {
  return BioPointer(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

X509Pointer ReadCertificate(std::string_view pem) {
  const BioPointer bio = Memory(pem);
  X509Pointer certificate(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  return certificate;
}

// What one field of the subject says; empty where it is missing or not text.
std::string SubjectField(const X509* certificate, int nid) {
  const X509_NAME* subject = X509_get_subject_name(certificate);
  const int place = X509_NAME_get_index_by_NID(subject, nid, -1);
  if (place < 0) return "";
  unsigned char* text = nullptr;
  const ASN1_STRING* value = X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, place));
  const int size = ASN1_STRING_to_UTF8(&text, value);
  if (size < 0) return "";
  std::string result(reinterpret_cast<char*>(text), static_cast<size_t>(size));
  OPENSSL_free(text);
  return result;
}

std::string SerialOf(const X509* certificate) {
  BIGNUM* number = ASN1_INTEGER_to_BN(X509_get0_serialNumber(certificate), nullptr);
  char* text = number == nullptr ? nullptr : BN_bn2hex(number);
  std::string serial = text == nullptr ? "" : absl::AsciiStrToLower(text);
  OPENSSL_free(text);
  BN_free(number);
  const size_t first = serial.find_first_not_of('0');
  return first == std::string::npos ? "0" : serial.substr(first);
}

// The URIs in the subject's alternative names.
std::vector<std::string> Uris(const X509* certificate) {
  std::vector<std::string> uris;
  auto* const names = static_cast<GENERAL_NAMES*>(
      X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr));
  if (names == nullptr) return uris;
  for (int i = 0; i < sk_GENERAL_NAME_num(names); ++i) {
    const GENERAL_NAME* name = sk_GENERAL_NAME_value(names, i);
    if (name->type != GEN_URI) continue;
    const ASN1_IA5STRING* uri = name->d.uniformResourceIdentifier;
    uris.emplace_back(reinterpret_cast<const char*>(ASN1_STRING_get0_data(uri)),
                      static_cast<size_t>(ASN1_STRING_length(uri)));
  }
  GENERAL_NAMES_free(names);
  return uris;
}

int64_t EndUtcS(const X509* certificate) {
  std::tm time{};
  if (ASN1_TIME_to_tm(X509_get0_notAfter(certificate), &time) != 1) return 0;
  return timegm(&time);
}

// "certificate 3fa2 of 'pc1'": what it says of itself, escaped, for messages.
std::string Named(const X509* certificate) {
  return absl::StrCat("certificate ", SerialOf(certificate), " of '",
                      absl::CHexEscape(SubjectField(certificate, NID_commonName).substr(0, 64)),
                      "'");
}

// UNAUTHENTICATED says what is wrong.
absl::Status VerifyChain(X509_STORE* store, X509* certificate, int purpose, int64_t now_utc_s) {
  const ContextPointer context(X509_STORE_CTX_new());
  if (!context || X509_STORE_CTX_init(context.get(), store, certificate, nullptr) != 1) {
    return absl::InternalError("cannot verify a certificate: out of memory");
  }
  X509_STORE_CTX_set_purpose(context.get(), purpose);
  X509_VERIFY_PARAM_set_time(X509_STORE_CTX_get0_param(context.get()),
                             static_cast<time_t>(now_utc_s));
  const bool good = X509_verify_cert(context.get()) == 1;
  ERR_clear_error();
  if (good) return absl::OkStatus();
  const int error = X509_STORE_CTX_get_error(context.get());
  const char* advice = "";
  switch (error) {
    case X509_V_ERR_CERT_HAS_EXPIRED:
      advice = "; renew it, or join again, and compare the clocks of both PCs";
      break;
    case X509_V_ERR_CERT_NOT_YET_VALID:
      advice = "; compare the clocks of both PCs";
      break;
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
    case X509_V_ERR_CERT_SIGNATURE_FAILURE:
      advice = "; another CA has signed it: join this server with a string of its own";
      break;
    default:
      break;
  }
  return absl::UnauthenticatedError(absl::StrCat(
      Named(certificate), " is refused: ", X509_verify_cert_error_string(error), advice));
}

}  // namespace

absl::StatusOr<TrustedCa> TrustedCa::Parse(std::string_view pem) {
  TrustedCa ca;
  ca.store_ = std::shared_ptr<void>(
      X509_STORE_new(), [](void* store) { X509_STORE_free(static_cast<X509_STORE*>(store)); });
  const BioPointer bio = Memory(pem);
  int count = 0;
  while (true) {
    const X509Pointer certificate(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
    if (!certificate) break;
    if (X509_check_ca(certificate.get()) == 0) {
      ERR_clear_error();
      return absl::InvalidArgumentError(absl::StrCat(Named(certificate.get()), " is no CA's"));
    }
    X509_STORE_add_cert(static_cast<X509_STORE*>(ca.store_.get()), certificate.get());
    ++count;
  }
  ERR_clear_error();
  if (count == 0) return absl::InvalidArgumentError("holds no certificate");
  return ca;
}

absl::StatusOr<Peer> TrustedCa::Identify(std::string_view pem, int64_t now_utc_s) const {
  const X509Pointer certificate = ReadCertificate(pem);
  if (!certificate) return absl::UnauthenticatedError("the client's certificate cannot be read");
  RIGCAL_RETURN_IF_ERROR(VerifyChain(static_cast<X509_STORE*>(store_.get()), certificate.get(),
                                     X509_PURPOSE_SSL_CLIENT, now_utc_s));
  const auto refused = [&](const std::string& why) {
    return absl::UnauthenticatedError(absl::StrCat(Named(certificate.get()), " is refused: ", why));
  };
  Peer peer{.has_certificate = true,
            .serial = SerialOf(certificate.get()),
            .not_after_utc_s = EndUtcS(certificate.get())};
  const std::vector<std::string> uris = Uris(certificate.get());
  if (uris.size() != 1) return refused("it must have exactly one URI, who it is");
  peer.uri = uris[0];
  const bool is_agent = peer.uri.starts_with(kAgentUri);
  if (!is_agent && !peer.uri.starts_with(kUserUri)) {
    return refused("its URI is neither that of an agent nor that of a user");
  }
  peer.name = peer.uri.substr(is_agent ? kAgentUri.size() : kUserUri.size());
  if (!ValidateName("", peer.name).ok()) return refused("the name in its URI is not valid");
  const std::string role = SubjectField(certificate.get(), NID_organizationalUnitName);
  const std::optional<Role> parsed = ParseRole(role);
  if (!parsed || is_agent != (*parsed == Role::kAgent)) {
    return refused(absl::StrCat("its role '", absl::CHexEscape(role.substr(0, 32)),
                                "' does not go with ", peer.uri));
  }
  peer.role = *parsed;
  return peer;
}

absl::Status TrustedCa::CheckServerCertificate(std::string_view certificate_pem,
                                               std::string_view key_pem, int64_t now_utc_s) const {
  const X509Pointer certificate = ReadCertificate(certificate_pem);
  if (!certificate) return absl::InvalidArgumentError("the certificate cannot be read");
  const BioPointer bio = Memory(key_pem);
  const KeyPointer key(PEM_read_bio_PrivateKey(bio.get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  if (!key) return absl::InvalidArgumentError("the private key cannot be read");
  const bool matches = X509_check_private_key(certificate.get(), key.get()) == 1;
  ERR_clear_error();
  if (!matches) {
    return absl::InvalidArgumentError(
        absl::StrCat("the private key is not that of ", Named(certificate.get())));
  }
  const absl::Status chain = VerifyChain(static_cast<X509_STORE*>(store_.get()), certificate.get(),
                                         X509_PURPOSE_SSL_SERVER, now_utc_s);
  return chain.ok() ? chain : absl::InvalidArgumentError(chain.message());
}

absl::StatusOr<int64_t> CertificateEndUtcS(std::string_view pem) {
  const X509Pointer certificate = ReadCertificate(pem);
  if (!certificate) return absl::InvalidArgumentError("the certificate cannot be read");
  return EndUtcS(certificate.get());
}

}  // namespace rigcal::server
