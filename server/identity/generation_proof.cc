// SPDX-License-Identifier: Apache-2.0
#include "server/identity/generation_proof.h"

#include <fstream>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "common/identity/signature.h"

namespace rigcal::server {
namespace {

// Empty: it is not there, or cannot be read.
std::string ContentOf(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// Nothing else that the authority signs begins like this: certificates are DER.
std::string Claim(const std::string& server_id, uint64_t generation) {
  return absl::StrCat("rigcal generation ", generation, " of ", server_id);
}

}  // namespace

absl::StatusOr<std::string> ProveGeneration(const std::filesystem::path& folder,
                                            const std::string& server_id, uint64_t generation) {
  const std::string key = folder.empty() ? "" : ContentOf(folder / "ca.key");
  if (key.empty()) return std::string();
  return Sign(key, Claim(server_id, generation));
}

absl::Status CheckGenerationProof(const std::filesystem::path& folder, const std::string& server_id,
                                  uint64_t generation, const std::string& proof) {
  if (folder.empty() || ContentOf(folder / "ca.key").empty()) return absl::OkStatus();
  return CheckSignature(ContentOf(folder / "ca.crt"), Claim(server_id, generation), proof);
}

}  // namespace rigcal::server
