// SPDX-License-Identifier: Apache-2.0
#include "server/identity/token_store.h"

#include <algorithm>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/identity/join_string.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "server/identity/json_fields.h"

namespace rigcal::server {
namespace {

constexpr absl::Duration kListedAfterExpiry = absl::Hours(24 * 7);

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

// Why nobody can use it; empty: somebody can.
std::string WhySpent(const Token& token, absl::Time now) {
  if (token.revoked) return "was revoked";
  if (token.used) {
    return absl::StrCat("was already used, at ", JsonTime(*token.used), " by ", token.used_by);
  }
  if (token.expires <= now) return absl::StrCat("expired at ", JsonTime(token.expires));
  return "";
}

absl::Status Refused(const std::string& why) {
  return absl::PermissionDeniedError(absl::StrCat(
      "the join string ", why, "; make a new one on the server PC with rigcal token create"));
}

}  // namespace

TokenStore::TokenStore(std::filesystem::path file)
    : file_(std::move(file)), spent_file_(file_.parent_path() / "spent_tokens.json") {}

absl::StatusOr<TokenStore> TokenStore::Open(std::filesystem::path file) {
  TokenStore store(std::move(file));
  RIGCAL_RETURN_IF_ERROR(store.ReadSpent());
  const absl::StatusOr<std::string> text = ReadSmallFile(store.file_);
  if (absl::IsNotFound(text.status())) return store;
  if (!text.ok()) return text.status();
  const auto json = ParseJson<IdentityJson>(*text);
  bool good = json.is_object() && json.contains("tokens") && json["tokens"].is_array();
  if (good) {
    for (const IdentityJson& entry : json["tokens"]) {
      const std::optional<Token> token = TokenFromJson(entry);
      good = good && token.has_value();
      // A list from an older backup: what has left it since is not good again.
      if (token && std::ranges::find(store.spent_, token->secret_sha256,
                                     &SpentToken::secret_sha256) == store.spent_.end()) {
        store.tokens_.push_back(*token);
      }
    }
  }
  if (good) return store;
  return absl::DataLossError(
      absl::StrCat(store.file_.string(),
                   " is damaged; remove it: only join strings that nobody has "
                   "used yet are lost, and can be made again"));
}

absl::Status TokenStore::ReadSpent() {
  const absl::StatusOr<std::string> text = ReadSmallFile(spent_file_);
  if (absl::IsNotFound(text.status())) return absl::OkStatus();
  if (!text.ok()) return text.status();
  const auto json = ParseJson<IdentityJson>(*text);
  bool good = json.is_object() && json.contains("spent") && json["spent"].is_array();
  if (good) {
    for (const IdentityJson& entry : json["spent"]) {
      JsonFields fields(entry);
      spent_.push_back({.secret_sha256 = fields.Text("secret_sha256"),
                        .expires = fields.Time("expires"),
                        .why = fields.Text("why")});
      good = good && fields.good();
    }
  }
  if (good) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat(spent_file_.string(),
                   " is damaged; remove it: the server forgets what became of old join strings, "
                   "which are refused all the same"));
}

absl::Status TokenStore::MoveSpent(std::vector<Token>* tokens, absl::Time now) {
  std::vector<SpentToken> spent = spent_;
  const auto is_spent = [&](const Token& token) { return !WhySpent(token, now).empty(); };
  const auto is_old = [&](const Token& token) {
    return !token.used && token.expires + kListedAfterExpiry < now;
  };
  auto surplus =
      std::ranges::count_if(*tokens, is_spent) - static_cast<std::ptrdiff_t>(kListedSpentTokens);
  const size_t left = std::erase_if(*tokens, [&](const Token& token) {
    if (!is_spent(token) || (surplus <= 0 && !is_old(token))) return false;
    --surplus;
    spent.push_back({token.secret_sha256, token.expires, WhySpent(token, now)});
    return true;
  });
  if (left == 0) return absl::OkStatus();
  if (spent.size() > kSpentTokens) {
    spent.erase(spent.begin(), spent.end() - static_cast<std::ptrdiff_t>(kSpentTokens));
  }
  IdentityJson list = IdentityJson::array();
  for (const SpentToken& token : spent) {
    list.push_back({{"secret_sha256", token.secret_sha256},
                    {"expires", JsonTime(token.expires)},
                    {"why", token.why}});
  }
  // Before they leave the list: a power cut in between leaves them in both.
  RIGCAL_RETURN_IF_ERROR(
      WriteDurableFile(spent_file_, IdentityJson{{"spent", list}}.dump() + "\n"));
  spent_ = std::move(spent);
  return absl::OkStatus();
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
  const auto usable = std::ranges::count_if(
      tokens, [&](const Token& token) { return WhySpent(token, now).empty(); });
  if (static_cast<size_t>(usable) >= kMostTokens) {
    return absl::ResourceExhaustedError(
        absl::StrCat("there are ", kMostTokens,
                     " join strings that nobody has used yet; wait until they expire, or revoke "
                     "some: rigcal token list, rigcal token revoke ID"));
  }
  RIGCAL_RETURN_IF_ERROR(MoveSpent(&tokens, now));
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
  const std::string hash = HexSha256(secret);
  const auto token = std::ranges::find(tokens_, hash, &Token::secret_sha256);
  if (token == tokens_.end()) {
    const auto spent = std::ranges::find(spent_, hash, &SpentToken::secret_sha256);
    if (spent != spent_.end()) return Refused(spent->why);
    return Refused("is not known here: it is of another server, or is long spent");
  }
  const bool again =
      !token->revoked && token->used && token->key_sha256 == key_sha256 && now < token->expires;
  const std::string why = WhySpent(*token, now);
  if (!again && !why.empty()) return Refused(why);
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
                                            "'; rigcal token list shows them, and rigcal agent "
                                            "forget NAME refuses an agent that joined long ago"));
  }
  token->revoked = true;
  Token revoked = *token;
  RIGCAL_RETURN_IF_ERROR(Save(std::move(tokens)));
  return revoked;
}

}  // namespace rigcal::server
