// SPDX-License-Identifier: Apache-2.0
#include "server/identity/token_store.h"

#include <algorithm>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/identity/durable_file.h"
#include "common/identity/join_string.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "server/identity/json_fields.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxTokens = 1000;
constexpr absl::Duration kKeptAfterExpiry = absl::Hours(24 * 7);

std::string HexSha256(std::string_view bytes) { return absl::BytesToHexString(Sha256(bytes)); }

IdentityJson ToJson(const Token& token) {
  IdentityJson json = {{"id", token.id},
                       {"role", RoleName(token.role)},
                       {"name", token.name},
                       {"created", JsonTime(token.created)},
                       {"expires", JsonTime(token.expires)},
                       {"secret_sha256", token.secret_sha256}};
  if (token.revoked) json["revoked"] = true;
  if (token.used) {
    json["used"] = JsonTime(*token.used);
    json["used_by"] = token.used_by;
    json["key_sha256"] = token.key_sha256;
  }
  return json;
}

std::optional<Token> TokenFromJson(const IdentityJson& json) {
  JsonFields fields(json);
  Token token{.id = fields.Text("id"),
              .name = fields.Text("name"),
              .created = fields.Time("created"),
              .expires = fields.Time("expires"),
              .revoked = fields.Flag("revoked"),
              .secret_sha256 = fields.Text("secret_sha256")};
  const std::optional<Role> role = RoleFromName(fields.Text("role"));
  if (fields.Has("used")) {
    token.used = fields.Time("used");
    token.used_by = fields.Text("used_by");
    token.key_sha256 = fields.Text("key_sha256");
  }
  if (!fields.good() || !role) return std::nullopt;
  token.role = *role;
  return token;
}

absl::Status Refused(const std::string& why) {
  return absl::PermissionDeniedError(absl::StrCat(
      "the join string ", why, "; make a new one on the server PC with rigcal token create"));
}

}  // namespace

absl::StatusOr<TokenStore> TokenStore::Open(std::filesystem::path file) {
  TokenStore store(std::move(file));
  const absl::StatusOr<std::string> text = ReadSmallFile(store.file_);
  if (absl::IsNotFound(text.status())) return store;
  if (!text.ok()) return text.status();
  const auto json = ParseJson<IdentityJson>(*text);
  bool good = json.is_object() && json.contains("tokens") && json["tokens"].is_array();
  if (good) {
    for (const IdentityJson& entry : json["tokens"]) {
      const std::optional<Token> token = TokenFromJson(entry);
      good = good && token.has_value();
      if (token) store.tokens_.push_back(*token);
    }
  }
  if (good) return store;
  return absl::DataLossError(
      absl::StrCat(store.file_.string(),
                   " is damaged; remove it: only join strings that nobody has "
                   "used yet are lost, and can be made again"));
}

absl::Status TokenStore::Save(std::vector<Token> tokens) {
  IdentityJson list = IdentityJson::array();
  for (const Token& token : tokens) list.push_back(ToJson(token));
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(file_, IdentityJson{{"tokens", list}}.dump(1) + "\n"));
  tokens_ = std::move(tokens);
  return absl::OkStatus();
}

absl::StatusOr<TokenStore::Created> TokenStore::Create(Role role, absl::Duration ttl,
                                                       std::string name, absl::Time now) {
  std::vector<Token> tokens = tokens_;
  std::erase_if(tokens, [&](const Token& token) {
    return !token.used && token.expires + kKeptAfterExpiry < now;
  });
  if (tokens.size() >= kMaxTokens) {
    return absl::ResourceExhaustedError(
        absl::StrCat("there are ", kMaxTokens,
                     " tokens; revoke those of PCs that are gone: rigcal "
                     "token list, rigcal token revoke ID"));
  }
  RIGCAL_ASSIGN_OR_RETURN(std::string secret, RandomBytes(kJoinSecretBytes));
  RIGCAL_ASSIGN_OR_RETURN(const std::string id, RandomBytes(4));
  Token token{.id = absl::StrCat("t-", absl::BytesToHexString(id)),
              .role = role,
              .name = std::move(name),
              .created = now,
              .expires = now + ttl,
              .secret_sha256 = HexSha256(secret)};
  tokens.push_back(token);
  RIGCAL_RETURN_IF_ERROR(Save(std::move(tokens)));
  return Created{std::move(token), std::move(secret)};
}

absl::StatusOr<Token> TokenStore::Find(std::string_view secret, std::string_view key_sha256,
                                       absl::Time now) const {
  // Hashes are compared: how long that takes tells nothing about the secret.
  const auto token = std::ranges::find(tokens_, HexSha256(secret), &Token::secret_sha256);
  if (token == tokens_.end()) return Refused("is not known here: it is of another server");
  if (token->revoked) return Refused("was revoked");
  if (token->used) {
    if (token->key_sha256 == key_sha256 && now < token->expires) return *token;
    return Refused(
        absl::StrCat("was already used, at ", JsonTime(*token->used), " by ", token->used_by));
  }
  if (token->expires <= now) return Refused("expired at " + JsonTime(token->expires));
  return *token;
}

absl::Status TokenStore::MarkUsed(std::string_view id, std::string_view used_by,
                                  std::string_view key_sha256, absl::Time now) {
  std::vector<Token> tokens = tokens_;
  const auto token = std::ranges::find(tokens, id, &Token::id);
  if (token == tokens.end()) return absl::NotFoundError("no such token");
  token->used = now;
  token->used_by = std::string(used_by);
  token->key_sha256 = std::string(key_sha256);
  return Save(std::move(tokens));
}

absl::StatusOr<Token> TokenStore::Revoke(std::string_view id) {
  std::vector<Token> tokens = tokens_;
  const auto token = std::ranges::find(tokens, id, &Token::id);
  if (token == tokens.end()) {
    return absl::NotFoundError(absl::StrCat("there is no token '",
                                            absl::CHexEscape(std::string(id)),
                                            "'; rigcal token list shows them"));
  }
  token->revoked = true;
  Token revoked = *token;
  RIGCAL_RETURN_IF_ERROR(Save(std::move(tokens)));
  return revoked;
}

}  // namespace rigcal::server
