// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace rigcal::server {

// The folder of keys and certificates: <data_dir>/identity.
std::filesystem::path IdentityDirectory(const std::filesystem::path& data_dir);

// Makes what is missing of ca.crt, ca.key, server.crt and server.key, and renews server.crt where
// it lacks one of `hosts` (DNS names and IP addresses), names others, or is older than
// kServerRenewalAge. A new certificate is checked and then put in the place of the old one at once.
//   INVALID_ARGUMENT     a host is neither a name nor an address
//   FAILED_PRECONDITION  files are damaged or do not belong together; the message says what to do
absl::Status EnsureServerIdentity(const std::filesystem::path& data_dir,
                                  const std::vector<std::string>& hosts,
                                  absl::Time now = absl::Now());

// The folder (IdentityDirectory) has a CA without its key: its certificates are made elsewhere.
// EnsureServerIdentity leaves them as they are, if they belong together.
bool HasForeignCa(const std::filesystem::path& folder);

// The name that this PC has been given; empty: it has none.
std::string OwnHostName();

// Where others reach a server that listens on this host: every address and the names of this PC for
// "0.0.0.0" and "[::]", else the host itself. Link-local addresses are left out.
std::vector<std::string> ReachableHosts(const std::string& listen_host);

// True for 127.0.0.0/8, ::1 and localhost.
bool IsLoopbackHost(const std::string& host);

}  // namespace rigcal::server
