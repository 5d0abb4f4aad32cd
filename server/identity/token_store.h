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

// The tokens of a server in one file, tokens.json; each change is on disk when a function returns.
// Tokens that nobody used are forgotten a week after they expired. Not for several threads.
class TokenStore {
 public:
  // DATA_LOSS: the file is damaged; the message says what to do.
  static absl::StatusOr<TokenStore> Open(std::filesystem::path file);

  struct Created {
    Token token;
    std::string secret;  // kept nowhere
  };
  // RESOURCE_EXHAUSTED: there are too many.
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
  explicit TokenStore(std::filesystem::path file) : file_(std::move(file)) {}

  // Writes `tokens` and, where that succeeded, holds them.
  absl::Status Save(std::vector<Token> tokens);

  std::filesystem::path file_;
  std::vector<Token> tokens_;
};

}  // namespace rigcal::server
