// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/identity/denied_certificates.h"
#include "server/identity/identity_registry.h"
#include "server/identity/watched_file.h"

namespace rigcal::server {

// Whether a certificate that this server's CA has signed may be used: it is on record in
// identities.json, and denied.json does not deny it. Where the CA's key is kept elsewhere (no
// ca.key in the folder) its certificates are given out elsewhere too, and only the second counts.
// Both files are read again when they have changed, so that what this or another object writes
// counts at once. Thread-safe.
class AcceptedCertificates {
 public:
  // `folder` is IdentityDirectory(data_dir).
  explicit AcceptedCertificates(const std::filesystem::path& folder);

  enum class Standing {
    kAccepted,
    kRevoked,
    // Given out after the backup that was restored here, or its record was lost.
    kNotOnRecord,
  };
  // `serial` is as in Certificate::serial. Two system calls where neither file has changed.
  // DATA_LOSS and errors of the file system: everybody must be refused until they are repaired.
  absl::StatusOr<Standing> Find(std::string_view uri, std::string_view serial);

  DeniedCertificates& denied() { return denied_; }

 private:
  using Records = std::map<std::string, IdentityRecord, std::less<>>;

  DeniedCertificates denied_;
  const bool needs_record_;
  std::mutex mutex_;
  WatchedFile<Records> records_;
  absl::Status logged_;
};

// Why it is not accepted, with what to do: "was revoked; to let it in again, ...". Empty: it is.
std::string WhyNotAccepted(AcceptedCertificates::Standing standing);

}  // namespace rigcal::server
