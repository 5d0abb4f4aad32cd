// SPDX-License-Identifier: Apache-2.0
#include "common/identity/certificate.h"

#include <arpa/inet.h>
#include <openssl/err.h>
#include <openssl/pem.h>

#include <algorithm>
#include <array>
#include <cstdlib>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/identity/openssl_handles.h"
#include "common/identity/private_key.h"

namespace rigcal {
namespace {

absl::Time TimeOf(const ASN1_TIME* time) {
  std::tm parts{};
  if (time == nullptr || ASN1_TIME_to_tm(time, &parts) != 1) return absl::InfinitePast();
  return absl::FromTM(parts, absl::UTCTimeZone());
}

std::string TextOf(const ASN1_STRING* text) {
  return {reinterpret_cast<const char*>(ASN1_STRING_get0_data(text)),
          static_cast<size_t>(ASN1_STRING_length(text))};
}

std::string AddressText(const ASN1_OCTET_STRING* address) {
  const int size = ASN1_STRING_length(address);
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (size != 4 && size != 16) return "";
  inet_ntop(size == 4 ? AF_INET : AF_INET6, ASN1_STRING_get0_data(address), text.data(),
            static_cast<socklen_t>(text.size()));
  return text.data();
}

void ReadNames(const X509* x509, Certificate* certificate) {
  const openssl::NamesPtr names(
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(x509, NID_subject_alt_name, nullptr, nullptr)));
  int uri_count = 0;
  for (int i = 0; names && i < sk_GENERAL_NAME_num(names.get()); ++i) {
    const GENERAL_NAME* const name = sk_GENERAL_NAME_value(names.get(), i);
    if (name->type == GEN_URI) {
      certificate->uri = TextOf(name->d.uniformResourceIdentifier);
      ++uri_count;
    } else if (name->type == GEN_DNS) {
      certificate->hosts.push_back(TextOf(name->d.dNSName));
    } else if (name->type == GEN_IPADD) {
      certificate->hosts.push_back(AddressText(name->d.iPAddress));
    }
  }
  if (uri_count > 1) certificate->uri.clear();
}

std::string SerialText(const X509* x509) {
  const openssl::NumberPtr number(ASN1_INTEGER_to_BN(X509_get0_serialNumber(x509), nullptr));
  char* const text = number ? BN_bn2hex(number.get()) : nullptr;
  const std::string digits = text == nullptr ? "" : text;
  OPENSSL_free(text);
  const size_t first = digits.find_first_not_of('0');
  return first == std::string::npos ? "0" : absl::AsciiStrToLower(digits.substr(first));
}

std::string DerOf(X509* x509) {
  unsigned char* bytes = nullptr;
  const int size = i2d_X509(x509, &bytes);
  if (size < 0) return "";
  std::string der(reinterpret_cast<const char*>(bytes), static_cast<size_t>(size));
  OPENSSL_free(bytes);
  return der;
}

// What to do about an error of X509_verify_cert.
const char* AdviceOn(int error) {
  switch (error) {
    case X509_V_ERR_CERT_HAS_EXPIRED:
      return "; renew it, or join again, and compare the clocks of both PCs";
    case X509_V_ERR_CERT_NOT_YET_VALID:
      return "; compare the clocks of both PCs";
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
    case X509_V_ERR_CERT_SIGNATURE_FAILURE:
      return "; another CA has signed it: join this server with a string of its own";
    default:
      return "";
  }
}

Certificate CertificateOf(X509* x509) {
  const X509_NAME* const subject = X509_get_subject_name(x509);
  Certificate certificate{
      .name = openssl::SubjectEntry(subject, NID_commonName),
      .unit = openssl::SubjectEntry(subject, NID_organizationalUnitName),
  };
  certificate.role = RoleFromName(certificate.unit);
  ReadNames(x509, &certificate);
  certificate.serial = SerialText(x509);
  certificate.sha256 = Sha256(DerOf(x509));
  certificate.not_before = TimeOf(X509_get0_notBefore(x509));
  certificate.not_after = TimeOf(X509_get0_notAfter(x509));
  return certificate;
}

// Of any kind: some readers of PEM take more kinds than others.
size_t PemBlocks(std::string_view text) {
  constexpr std::string_view kBegin = "-----BEGIN ";
  size_t blocks = 0;
  for (size_t at = text.find(kBegin); at != std::string_view::npos;
       at = text.find(kBegin, at + kBegin.size())) {
    ++blocks;
  }
  return blocks;
}

}  // namespace

absl::StatusOr<Certificate> ParseCertificate(std::string_view pem) {
  const openssl::CertificatePtr x509 = openssl::CertificateFromPem(pem);
  if (!x509) return absl::InvalidArgumentError("not a certificate in PEM form");
  Certificate certificate = CertificateOf(x509.get());
  certificate.pem = std::string(pem);
  return certificate;
}

absl::StatusOr<Certificate> ParseCertificateFile(std::string_view text) {
  if (const size_t blocks = PemBlocks(text); blocks > 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("holds ", blocks, " PEM blocks where one certificate is expected"));
  }
  const openssl::CertificatePtr x509 = openssl::CertificateFromPem(text);
  if (!x509) return absl::InvalidArgumentError("is not a certificate in PEM form");
  const openssl::BioPtr out = openssl::WriteBio();
  if (PEM_write_bio_X509(out.get(), x509.get()) != 1) return openssl::Error("write a certificate");
  Certificate certificate = CertificateOf(x509.get());
  certificate.pem = openssl::TextOf(out);
  return certificate;
}

absl::StatusOr<Certificate> ParseOnlyCertificate(std::string_view pem) {
  auto certificate = ParseCertificateFile(pem);
  if (!certificate.ok()) return certificate;
  const absl::string_view block =
      absl::StripAsciiWhitespace(absl::string_view(pem.data(), pem.size()));
  if (absl::StartsWith(block, "-----BEGIN CERTIFICATE-----") &&
      absl::EndsWith(block, "-----END CERTIFICATE-----")) {
    return certificate;
  }
  return absl::InvalidArgumentError("holds other text beside the certificate");
}

std::string Describe(const Certificate& certificate) {
  return absl::StrCat("certificate ", certificate.serial, " of '",
                      absl::CHexEscape(certificate.name.substr(0, 64)), "'");
}

absl::Status CheckIssuedBy(const Certificate& certificate, std::string_view ca_pem,
                           CertificateUse use, std::optional<absl::Time> time) {
  const openssl::CertificatePtr x509 = openssl::CertificateFromPem(certificate.pem);
  const std::vector<openssl::CertificatePtr> cas = openssl::CertificatesFromPem(ca_pem);
  if (!x509 || cas.empty()) return absl::UnauthenticatedError("not a certificate in PEM form");
  const openssl::StorePtr store(X509_STORE_new());
  const openssl::StoreContextPtr context(X509_STORE_CTX_new());
  bool ready = store && context;
  // Of several CAs with one name OpenSSL might take one that has not signed.
  const auto signer = std::ranges::find_if(cas, [&](const auto& ca) {
    return X509_verify(x509.get(), X509_get0_pubkey(ca.get())) == 1;
  });
  for (auto ca = cas.begin(); ca != cas.end(); ++ca) {
    if (signer != cas.end() && ca != signer &&
        X509_NAME_cmp(X509_get_subject_name(ca->get()), X509_get_subject_name(signer->get())) ==
            0) {
      continue;
    }
    ready = ready && X509_STORE_add_cert(store.get(), ca->get()) == 1;
  }
  if (!ready || X509_STORE_CTX_init(context.get(), store.get(), x509.get(), nullptr) != 1) {
    return openssl::Error("check a certificate");
  }
  X509_VERIFY_PARAM* const rules = X509_STORE_CTX_get0_param(context.get());
  if (time) {
    X509_VERIFY_PARAM_set_time(rules, absl::ToTimeT(*time));
  } else {
    X509_VERIFY_PARAM_set_flags(rules, X509_V_FLAG_NO_CHECK_TIME);
  }
  X509_VERIFY_PARAM_set_purpose(
      rules, use == CertificateUse::kServer ? X509_PURPOSE_SSL_SERVER : X509_PURPOSE_SSL_CLIENT);
  const bool good = X509_verify_cert(context.get()) == 1;
  ERR_clear_error();
  if (good) return absl::OkStatus();
  const int error = X509_STORE_CTX_get_error(context.get());
  return absl::UnauthenticatedError(
      absl::StrCat(Describe(certificate), " is refused: ", X509_verify_cert_error_string(error),
                   AdviceOn(error)));
}

absl::Status CheckCaCertificates(std::string_view pem) {
  const std::vector<openssl::CertificatePtr> cas = openssl::CertificatesFromPem(pem);
  if (cas.empty()) return absl::InvalidArgumentError("holds no certificate");
  for (const auto& ca : cas) {
    const bool is_ca = X509_check_ca(ca.get()) != 0;
    ERR_clear_error();
    if (is_ca) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(Describe(CertificateOf(ca.get())), " is no CA's"));
  }
  return absl::OkStatus();
}

}  // namespace rigcal
