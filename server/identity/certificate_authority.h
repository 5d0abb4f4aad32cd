// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/identity/certificate.h"
#include "common/identity/role.h"

namespace rigcal::server {

// Of agents and users.
inline constexpr absl::Duration kPeerLifetime = absl::Hours(24 * 30);
// A certificate begins a day early: a server whose clock is set back a little still takes it.
inline constexpr absl::Duration kPeerBackdate = absl::Hours(24);
// A PC that slept may renew for so long after its certificate's end.
inline constexpr absl::Duration kRenewalGrace = absl::Hours(24 * 90);
// The server's own is valid for those whose clock is a year off, in both directions, and replaced
// long before that ends.
inline constexpr absl::Duration kServerBackdate = absl::Hours(24 * 400);
inline constexpr absl::Duration kServerLifetime = absl::Hours(24 * 420);
inline constexpr absl::Duration kServerRenewalAge = absl::Hours(24 * 30);

// This server's own certificate authority: ca.crt and ca.key in its folder. Not for several
// threads at a time, except for Issue.
class CertificateAuthority {
 public:
  // Makes it where neither file exists. FAILED_PRECONDITION: one is missing, or they are damaged or
  // do not belong together: never replaced without being asked, since all certificates hang on it.
  static absl::StatusOr<CertificateAuthority> Open(const std::filesystem::path& folder);

  const std::string& pem() const { return pem_; }
  const std::string& sha256() const { return sha256_; }

  // A certificate (PEM) for the holder of a public key (DER).
  struct PeerRequest {
    Role role = Role::kAgent;
    std::string name;
    std::string public_key;
  };
  absl::StatusOr<std::string> IssuePeer(const PeerRequest& request, absl::Time now) const;
  // For this server's own key (PEM); `hosts` are DNS names and IP addresses.
  absl::StatusOr<std::string> IssueServer(std::string_view key_pem,
                                          const std::vector<std::string>& hosts,
                                          absl::Time now) const;

 private:
  CertificateAuthority() = default;

  std::string pem_;
  std::string key_pem_;
  std::string sha256_;
};

}  // namespace rigcal::server
