// SPDX-License-Identifier: Apache-2.0
#include "server/identity/server_identity.h"

#include <arpa/inet.h>

#include <array>
#include <set>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/identity/certificate.h"
#include "common/identity/join_string.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "server/identity/certificate_authority.h"

namespace rigcal::server {
namespace {

// As certificates spell it: each address in one form only.
std::string CanonicalHost(const std::string& host) {
  std::array<unsigned char, 16> bytes{};
  std::array<char, INET6_ADDRSTRLEN> text{};
  for (const int family : {AF_INET, AF_INET6}) {
    if (inet_pton(family, host.c_str(), bytes.data()) == 1 &&
        inet_ntop(family, bytes.data(), text.data(), text.size()) != nullptr) {
      return text.data();
    }
  }
  return host;
}

// With the names of this PC for itself, sorted.
absl::StatusOr<std::vector<std::string>> NamesFor(const std::vector<std::string>& hosts) {
  std::set<std::string> names = {"localhost", "127.0.0.1", "::1"};
  for (const std::string& host : hosts) {
    if (!IsHostText(host)) {
      return absl::InvalidArgumentError(
          absl::StrCat("'", host, "' is neither a name nor an address of this PC"));
    }
    names.insert(CanonicalHost(host));
  }
  return std::vector(names.begin(), names.end());
}

// It can be used as it is.
bool IsCurrent(const std::string& pem, const std::string& key, const CertificateAuthority& ca,
               const std::vector<std::string>& names, absl::Time now) {
  const absl::StatusOr<Certificate> certificate = ParseCertificate(pem);
  if (!certificate.ok() || !CheckKeyOf(pem, key, "").ok()) return false;
  const absl::Duration age = now - (certificate->not_before + kServerBackdate);
  // A negative age: the clock was ahead when it was made.
  return CheckIssuedBy(*certificate, ca.pem(), CertificateUse::kServer).ok() &&
         age < kServerRenewalAge && age > -absl::Hours(24) && certificate->hosts == names;
}

// Certificates that were made elsewhere: they are used as they are, and nobody joins here.
bool IsOfForeignCa(const std::filesystem::path& folder) {
  const absl::StatusOr<std::string> ca = ReadSmallFile(folder / "ca.crt");
  const absl::StatusOr<std::string> certificate = ReadSmallFile(folder / "server.crt");
  const absl::StatusOr<std::string> key = ReadSmallFile(folder / "server.key");
  if (!ca.ok() || !certificate.ok() || !key.ok() || !HasForeignCa(folder)) return false;
  const absl::StatusOr<Certificate> parsed = ParseCertificate(*certificate);
  return parsed.ok() && CheckKeyOf(*certificate, *key, "").ok() &&
         CheckIssuedBy(*parsed, *ca, CertificateUse::kServer).ok();
}

}  // namespace

bool HasForeignCa(const std::filesystem::path& folder) {
  std::error_code error;
  return std::filesystem::exists(folder / "ca.crt", error) &&
         !std::filesystem::exists(folder / "ca.key", error) && !error;
}

std::filesystem::path IdentityDirectory(const std::filesystem::path& data_dir) {
  return data_dir / "identity";
}

absl::Status EnsureServerIdentity(const std::filesystem::path& data_dir,
                                  const std::vector<std::string>& hosts, absl::Time now) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<std::string> names, NamesFor(hosts));
  const std::filesystem::path folder = IdentityDirectory(data_dir);
  if (IsOfForeignCa(folder)) return absl::OkStatus();
  RIGCAL_ASSIGN_OR_RETURN(const CertificateAuthority ca, CertificateAuthority::Open(folder));
  absl::StatusOr<std::string> key = ReadSmallFile(folder / "server.key");
  const absl::StatusOr<std::string> old = ReadSmallFile(folder / "server.crt");
  if (key.ok() && old.ok() && IsCurrent(*old, *key, ca, names, now)) return absl::OkStatus();
  // The key stays as long as it can be used: so the certificate is the only file to be replaced,
  // and nobody can see a new one beside an old key.
  bool is_new_key = absl::IsNotFound(key.status());
  absl::StatusOr<std::string> certificate = absl::UnknownError("");
  if (key.ok()) {
    certificate = ca.IssueServer(*key, names, now);
    is_new_key = !certificate.ok();
  }
  if (is_new_key) {
    RIGCAL_ASSIGN_OR_RETURN(key, MakePrivateKey());
    certificate = ca.IssueServer(*key, names, now);
  }
  if (!key.ok()) return key.status();
  if (!certificate.ok()) return certificate.status();
  RIGCAL_RETURN_IF_ERROR(CheckKeyOf(*certificate, *key, "server.crt and server.key"));
  RIGCAL_ASSIGN_OR_RETURN(const Certificate parsed, ParseCertificate(*certificate));
  RIGCAL_RETURN_IF_ERROR(CheckIssuedBy(parsed, ca.pem(), CertificateUse::kServer));
  if (is_new_key) RIGCAL_RETURN_IF_ERROR(WriteDurableFile(folder / "server.key", *key));
  return WriteDurableFile(folder / "server.crt", *certificate);
}

}  // namespace rigcal::server
