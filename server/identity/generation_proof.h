// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

// A signature of the certificate authority in `folder` (IdentityDirectory) over a server's id and
// the generation of its data: agents show it to a server from which another one has taken over.
// Empty: this server has no authority of its own, so nobody can prove anything with it. Errors:
// those of OpenSSL.
absl::StatusOr<std::string> ProveGeneration(const std::filesystem::path& folder,
                                            const std::string& server_id, uint64_t generation);

// Whether the authority in `folder` has made that proof. OK, whatever the proof, for a server that
// has no authority of its own.
//   UNAUTHENTICATED  it has not
absl::Status CheckGenerationProof(const std::filesystem::path& folder, const std::string& server_id,
                                  uint64_t generation, const std::string& proof);

}  // namespace rigcal::server
