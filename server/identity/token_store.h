// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/identity/role.h"

namespace rigcal::server {

// That can be used, at a time.
inline constexpr size_t kMostTokens = 1000;
inline constexpr size_t kListedSpentTokens = 500;
// At most 250 bytes each: together below the limit of ReadSmallFile.
inline constexpr size_t kSpentTokens = 4000;

// What a join string stands for, as the server keeps it.
struct Token {
  std::string id = {};  // "t-" and eight hexadecimal digits; not a secret
  Role role = Role::kAgent;
  std::string name = {};  // of the certificate; empty: the one who joins chooses
  absl::Time created = {};
  absl::Time expires = {};
  bool revoked = false;
  std::optional<absl::Time> used = {};
  std::string used_by = {};        // URI of the certificate
  std::string secret_sha256 = {};  // hexadecimal
  std::string key_sha256 = {};     // of the public key that used it, hexadecimal
};

// The tokens of a server; each change is on disk when a function returns. Not for several threads.
//
// tokens.json, {"tokens": [...]}, lists those that can be used, and the last kListedSpentTokens of
// those that were used, were revoked, or expired less than a week ago. What leaves the list is in
// spent_tokens.json,
//   {"spent": [{"secret_sha256": "4f2a...", "expires": "2026-...", "why": "was already used,
//   ..."}]}
// the newest kSpentTokens of them, the newest last, so that it can be said what became of a join
// string. A secret is good only if it is in the list, so nothing comes back by being forgotten. Who
// puts an older tokens.json in the place of a newer one must keep the entries of both with "used"
// or "revoked", and the hashes of both files' "spent": they are never good again.
class TokenStore {
 public:
  // DATA_LOSS: the file is damaged; the message says what to do.
  static absl::StatusOr<TokenStore> Open(std::filesystem::path file);

  struct Created {
    Token token;
    std::string secret;  // kept nowhere
  };
  // RESOURCE_EXHAUSTED: there are kMostTokens that can be used.
  absl::StatusOr<Created> Create(Role role, absl::Duration ttl, std::string name, absl::Time now);
  // The oldest first.
  const std::vector<Token>& tokens() const { return tokens_; }
  // The token with this secret, if the holder of this key (SHA-256, hexadecimal) may use it now; he
  // may do so again, where he did not get the answer. PERMISSION_DENIED: unknown, expired, revoked
  // or used by another; the message says which.
  absl::StatusOr<Token> Find(std::string_view secret, std::string_view key_sha256,
                             absl::Time now) const;
  absl::Status MarkUsed(std::string_view id, std::string_view used_by, std::string_view key_sha256,
                        absl::Time now);
  // NOT_FOUND: there is none of this id. Returns the token.
  absl::StatusOr<Token> Revoke(std::string_view id);

 private:
  // A token that has left the list.
  struct SpentToken {
    std::string secret_sha256 = {};  // hexadecimal
    absl::Time expires = {};
    std::string why = {};  // "was already used, at ... by ..."
  };

  explicit TokenStore(std::filesystem::path file);

  absl::Status ReadSpent();
  // Takes those out of `tokens` that nobody can use and that are too many for the list.
  absl::Status MoveSpent(std::vector<Token>* tokens, absl::Time now);
  // Writes `tokens` and, where that succeeded, holds them.
  absl::Status Save(std::vector<Token> tokens);

  std::filesystem::path file_;
  std::filesystem::path spent_file_;
  std::vector<Token> tokens_;
  std::vector<SpentToken> spent_;  // the newest last
};

}  // namespace rigcal::server
