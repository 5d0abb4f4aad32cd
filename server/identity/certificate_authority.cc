// SPDX-License-Identifier: Apache-2.0
#include "server/identity/certificate_authority.h"

#include <arpa/inet.h>
#include <openssl/pem.h>

#include <array>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/file/durable_file.h"
#include "common/file/private_folder.h"
#include "common/identity/openssl_handles.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr int kSerialBytes = 16;
constexpr int kCaYears = 30;

// What makes one certificate differ from another.
struct CertificateProfile {
  std::string name = {};
  std::string unit = {};  // OU; empty: none
  std::string key_usage = {};
  std::string extended_key_usage = {};  // empty: none
  std::string basic_constraints = {};
  std::string alternative_names = {};  // as OpenSSL's configuration writes it; empty: none
  absl::Time not_before = {};
  absl::Time not_after = {};
};

bool SetTime(ASN1_TIME* time, absl::Time value) {
  return ASN1_TIME_adj(time, absl::ToTimeT(value), 0, 0) != nullptr;
}

bool SetSerial(X509* x509) {
  std::array<unsigned char, kSerialBytes> bytes{};
  const absl::StatusOr<std::string> random = RandomBytes(bytes.size());
  if (!random.ok()) return false;
  std::copy(random->begin(), random->end(), bytes.begin());
  // Positive, and never shorter when printed.
  bytes[0] = static_cast<unsigned char>((bytes[0] & 0x3f) | 0x40);
  const openssl::NumberPtr number(BN_bin2bn(bytes.data(), kSerialBytes, nullptr));
  return number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(x509)) != nullptr;
}

bool AddSubjectEntry(X509_NAME* subject, int nid, const std::string& text) {
  return text.empty() ||
         X509_NAME_add_entry_by_NID(subject, nid, MBSTRING_UTF8,
                                    reinterpret_cast<const unsigned char*>(text.data()),
                                    static_cast<int>(text.size()), -1, 0) == 1;
}

bool AddExtension(X509* x509, X509* issuer, int nid, const std::string& value) {
  if (value.empty()) return true;
  X509V3_CTX context;
  X509V3_set_ctx(&context, issuer, x509, nullptr, nullptr, 0);
  const openssl::ExtensionPtr extension(X509V3_EXT_conf_nid(nullptr, &context, nid, value.c_str()));
  return extension && X509_add_ext(x509, extension.get(), -1) == 1;
}

// `issuer` null: signed by itself.
absl::StatusOr<std::string> SignCertificate(const CertificateProfile& profile,
                                            EVP_PKEY* subject_key, X509* issuer,
                                            EVP_PKEY* issuer_key) {
  const openssl::CertificatePtr x509(X509_new());
  X509* const made = x509.get();
  X509_NAME* const subject = made == nullptr ? nullptr : X509_get_subject_name(made);
  const openssl::BioPtr out = openssl::WriteBio();
  if (subject == nullptr || X509_set_version(made, X509_VERSION_3) != 1 || !SetSerial(made) ||
      !AddSubjectEntry(subject, NID_organizationName, "rigcal") ||
      !AddSubjectEntry(subject, NID_organizationalUnitName, profile.unit) ||
      !AddSubjectEntry(subject, NID_commonName, profile.name) ||
      X509_set_issuer_name(made, X509_get_subject_name(issuer == nullptr ? made : issuer)) != 1 ||
      !SetTime(X509_getm_notBefore(made), profile.not_before) ||
      !SetTime(X509_getm_notAfter(made), profile.not_after) ||
      X509_set_pubkey(made, subject_key) != 1 ||
      !AddExtension(made, issuer, NID_basic_constraints, profile.basic_constraints) ||
      !AddExtension(made, issuer, NID_key_usage, profile.key_usage) ||
      !AddExtension(made, issuer, NID_ext_key_usage, profile.extended_key_usage) ||
      !AddExtension(made, issuer, NID_subject_key_identifier, "hash") ||
      !AddExtension(made, issuer == nullptr ? made : issuer, NID_authority_key_identifier,
                    "keyid") ||
      !AddExtension(made, issuer, NID_subject_alt_name, profile.alternative_names) ||
      X509_sign(made, issuer_key, EVP_sha256()) <= 0 || PEM_write_bio_X509(out.get(), made) != 1) {
    return openssl::Error(absl::StrCat("make the certificate of ", profile.name));
  }
  return openssl::TextOf(out);
}

absl::StatusOr<std::string> MakeCaCertificate(const std::string& key_pem, absl::Time now) {
  const openssl::KeyPtr key = openssl::PrivateKeyFromPem(key_pem);
  if (!key) return openssl::Error("read the CA's key");
  // Valid long before now, for those whose clock is behind.
  const CertificateProfile profile = {.name = "rigcal CA",
                                      .key_usage = "critical,keyCertSign,cRLSign",
                                      .basic_constraints = "critical,CA:TRUE,pathlen:0",
                                      .not_before = now - absl::Hours(24 * 365 * 10),
                                      .not_after = now + absl::Hours(24 * 365 * kCaYears)};
  return SignCertificate(profile, key.get(), nullptr, key.get());
}

bool IsAddress(const std::string& host) {
  std::array<unsigned char, 16> bytes{};
  return inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
         inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

absl::Status Broken(const std::filesystem::path& folder, const std::string& problem) {
  return absl::FailedPreconditionError(absl::StrCat(
      "the certificate authority in ", folder.string(), " cannot be used: ", problem,
      ". Restore ca.crt and ca.key from a backup; or remove the whole folder, and every agent and "
      "user must join again"));
}

}  // namespace

absl::StatusOr<CertificateAuthority> CertificateAuthority::Open(
    const std::filesystem::path& folder) {
  RIGCAL_RETURN_IF_ERROR(MakePrivateFolder(folder));
  const std::filesystem::path certificate_file = folder / "ca.crt";
  const std::filesystem::path key_file = folder / "ca.key";
  absl::StatusOr<std::string> certificate = ReadSmallFile(certificate_file);
  absl::StatusOr<std::string> key = ReadSmallFile(key_file);
  if (absl::IsNotFound(certificate.status())) {
    // A key without its certificate is what a first start leaves that was killed in between.
    if (absl::IsNotFound(key.status())) {
      key = MakePrivateKey();
      if (key.ok()) RIGCAL_RETURN_IF_ERROR(WriteDurableFile(key_file, *key));
    }
    if (!key.ok()) return key.status();
    certificate = MakeCaCertificate(*key, absl::Now());
    if (!certificate.ok()) return Broken(folder, std::string(certificate.status().message()));
    RIGCAL_RETURN_IF_ERROR(WriteDurableFile(certificate_file, *certificate));
  }
  if (!certificate.ok()) return Broken(folder, std::string(certificate.status().message()));
  if (!key.ok()) return Broken(folder, std::string(key.status().message()));
  if (const absl::Status pair = CheckKeyOf(*certificate, *key, "ca.crt and ca.key"); !pair.ok()) {
    return Broken(folder, std::string(pair.message()));
  }
  // Who joins trusts this certificate alone, whatever stands beside it in the file.
  const absl::StatusOr<Certificate> parsed = ParseCertificateFile(*certificate);
  if (!parsed.ok()) {
    return Broken(folder, absl::StrCat("ca.crt ", std::string(parsed.status().message())));
  }
  CertificateAuthority authority;
  authority.pem_ = parsed->pem;
  authority.key_pem_ = *std::move(key);
  authority.sha256_ = parsed->sha256;
  return authority;
}

absl::StatusOr<std::string> CertificateAuthority::IssuePeer(const PeerRequest& request,
                                                            absl::Time now) const {
  const auto* bytes = reinterpret_cast<const unsigned char*>(request.public_key.data());
  const openssl::KeyPtr subject_key(
      d2i_PUBKEY(nullptr, &bytes, static_cast<long>(request.public_key.size())));
  const openssl::CertificatePtr issuer = openssl::CertificateFromPem(pem_);
  const openssl::KeyPtr key = openssl::PrivateKeyFromPem(key_pem_);
  if (!subject_key || !issuer || !key) return openssl::Error("read the keys for a certificate");
  const CertificateProfile profile = {
      .name = request.name,
      .unit = std::string(RoleName(request.role)),
      .key_usage = "critical,digitalSignature",
      .extended_key_usage = "clientAuth",
      .basic_constraints = "critical,CA:FALSE",
      .alternative_names = absl::StrCat("URI:", PeerUri(request.role, request.name)),
      .not_before = now - kPeerBackdate,
      .not_after = now + kPeerLifetime};
  return SignCertificate(profile, subject_key.get(), issuer.get(), key.get());
}

absl::StatusOr<std::string> CertificateAuthority::IssueServer(std::string_view key_pem,
                                                              const std::vector<std::string>& hosts,
                                                              absl::Time now) const {
  const openssl::KeyPtr subject_key = openssl::PrivateKeyFromPem(key_pem);
  const openssl::CertificatePtr issuer = openssl::CertificateFromPem(pem_);
  const openssl::KeyPtr key = openssl::PrivateKeyFromPem(key_pem_);
  if (!subject_key || !issuer || !key) return openssl::Error("read the keys for a certificate");
  std::vector<std::string> names = {absl::StrCat("URI:", std::string(kServerUri))};
  for (const std::string& host : hosts) {
    names.push_back(absl::StrCat(IsAddress(host) ? "IP:" : "DNS:", host));
  }
  const CertificateProfile profile = {.name = "rigcal-server",
                                      .key_usage = "critical,digitalSignature",
                                      .extended_key_usage = "serverAuth",
                                      .basic_constraints = "critical,CA:FALSE",
                                      .alternative_names = absl::StrJoin(names, ","),
                                      .not_before = now - kServerBackdate,
                                      .not_after = now + kServerLifetime};
  return SignCertificate(profile, subject_key.get(), issuer.get(), key.get());
}

}  // namespace rigcal::server
