// SPDX-License-Identifier: Apache-2.0
#include "server/identity/restored_identity.h"

#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/file/durable_file.h"
#include "common/identity/certificate.h"
#include "common/status/status_macros.h"
#include "server/identity/denied_certificates.h"
#include "server/identity/identity_registry.h"
#include "server/identity/json_fields.h"

namespace rigcal::server {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxListBytes = size_t{16} << 20;

absl::StatusOr<IdentityJson> ReadList(const fs::path& file, const char* key) {
  const absl::StatusOr<std::string> text = ReadWholeFile(file, kMaxListBytes);
  if (absl::IsNotFound(text.status())) return IdentityJson{{key, IdentityJson::array()}};
  if (!text.ok()) return text.status();
  IdentityJson json = IdentityJson::parse(*text, nullptr, /*allow_exceptions=*/false);
  if (json.is_object() && json.contains(key) && json[key].is_array()) return json;
  return absl::DataLossError(absl::StrCat(file.string(), " is damaged"));
}

std::string TextIn(const IdentityJson& item, const char* key) { return JsonFields(item).Text(key); }

// A string that can still be used to join.
bool IsOpen(const IdentityJson& token) {
  return token.is_object() && !token.contains("used") && !JsonFields(token).Flag("revoked");
}

// Tokens by the hash of their secret.
std::map<std::string, IdentityJson> BySecret(const IdentityJson& tokens) {
  std::map<std::string, IdentityJson> by_secret;
  for (const IdentityJson& token : tokens) by_secret[TextIn(token, "secret_sha256")] = token;
  return by_secret;
}

// What became of a string that the backup does not have.
IdentityJson SpentSince(const IdentityJson& token) {
  return {{"secret_sha256", token["secret_sha256"]},
          {"expires", token["expires"]},
          {"why", token.contains("used")
                      ? absl::StrCat("was already used, at ", TextIn(token, "used"), " by ",
                                     TextIn(token, "used_by"),
                                     ", after the backup that this server was restored from")
                      : "was made after the backup that this server was restored from"}};
}

absl::Status CloseTokens(const fs::path& before, const fs::path& restored, size_t* closed) {
  constexpr char kTokens[] = "tokens";
  constexpr char kSpent[] = "spent";
  constexpr char kSpentFile[] = "spent_tokens.json";
  RIGCAL_ASSIGN_OR_RETURN(IdentityJson list, ReadList(restored / "tokens.json", kTokens));
  RIGCAL_ASSIGN_OR_RETURN(IdentityJson spent_list, ReadList(restored / kSpentFile, kSpent));
  // Where it cannot be told which have been used, all have.
  const absl::StatusOr<IdentityJson> list_since = ReadList(before / "tokens.json", kTokens);
  const absl::StatusOr<IdentityJson> spent_since = ReadList(before / kSpentFile, kSpent);
  std::map<std::string, IdentityJson> since, spent = BySecret(spent_list[kSpent]);
  if (list_since.ok()) since = BySecret((*list_since)[kTokens]);
  if (spent_since.ok()) spent.merge(BySecret((*spent_since)[kSpent]));
  for (IdentityJson& token : list[kTokens]) {
    const bool was_open = IsOpen(token);
    const auto newer = since.find(TextIn(token, "secret_sha256"));
    if (newer != since.end()) {
      token = newer->second;
      since.erase(newer);
    } else if (was_open) {
      token["revoked"] = true;
    }
    if (was_open && !IsOpen(token)) ++*closed;
  }
  for (const auto& [secret, token] : since) spent.try_emplace(secret, SpentSince(token));
  spent_list[kSpent] = IdentityJson::array();
  for (const auto& [secret, token] : spent) spent_list[kSpent].push_back(token);
  // First what a string that leaves the list needs to stay refused.
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(restored / kSpentFile, spent_list.dump() + "\n"));
  return WriteDurableFile(restored / "tokens.json", list.dump(1) + "\n");
}

absl::Status EndWebSessions(const fs::path& before, const fs::path& restored, size_t* ended) {
  constexpr char kKey[] = "sessions";
  RIGCAL_ASSIGN_OR_RETURN(IdentityJson sessions, ReadList(restored, kKey));
  const absl::StatusOr<IdentityJson> since = ReadList(before, kKey);
  std::set<std::string> signed_in;
  if (since.ok()) {
    for (const IdentityJson& session : (*since)[kKey]) {
      signed_in.insert(TextIn(session, "secret_sha256"));
    }
  }
  IdentityJson kept = IdentityJson::array();
  for (const IdentityJson& session : sessions[kKey]) {
    if (signed_in.contains(TextIn(session, "secret_sha256"))) kept.push_back(session);
  }
  *ended = sessions[kKey].size() - kept.size();
  sessions[kKey] = std::move(kept);
  return WriteDurableFile(restored, sessions.dump(1) + "\n");
}

absl::StatusOr<bool> IsSameCa(const fs::path& before, const fs::path& restored) {
  const absl::StatusOr<std::string> old_pem = ReadSmallFile(before / "ca.crt");
  const absl::StatusOr<std::string> new_pem = ReadSmallFile(restored / "ca.crt");
  if (!old_pem.ok() || !new_pem.ok()) return false;
  const absl::StatusOr<Certificate> old_ca = ParseCertificate(*old_pem);
  const absl::StatusOr<Certificate> new_ca = ParseCertificate(*new_pem);
  return old_ca.ok() && new_ca.ok() && old_ca->sha256 == new_ca->sha256;
}

// With what to do, for who restores because the folder before is damaged.
absl::Status OrMoveAway(const absl::Status& status) {
  if (status.ok()) return status;
  return absl::Status(status.code(),
                      absl::StrCat("who was revoked since the backup cannot be told: ",
                                   std::string(status.message()),
                                   "; move that file away to restore without it, and revoke again "
                                   "whom you do not want"));
}

}  // namespace

absl::StatusOr<RestoredIdentity> TakeOverRevocations(const fs::path& before,
                                                     const fs::path& restored) {
  RestoredIdentity result;
  RIGCAL_ASSIGN_OR_RETURN(result.compared, IsSameCa(before, restored));
  if (!result.compared) return result;
  DeniedCertificates denied_before(before / "denied.json");
  DeniedCertificates denied(restored / "denied.json");
  RIGCAL_RETURN_IF_ERROR(OrMoveAway(denied.TakeAllOf(denied_before)));
  absl::StatusOr<IdentityRegistry> registry_before =
      IdentityRegistry::Open(before / "identities.json");
  if (!registry_before.ok()) return OrMoveAway(registry_before.status());
  RIGCAL_ASSIGN_OR_RETURN(IdentityRegistry registry,
                          IdentityRegistry::Open(restored / "identities.json"));
  const absl::Time now = absl::Now();
  RIGCAL_ASSIGN_OR_RETURN(const IdentityRegistry::Since since,
                          registry.TakeChangesOf(*registry_before, now));
  for (const IdentityRecord& replaced : since.replaced) {
    std::set<std::string> serials;
    for (const auto& [serial, expires] : replaced.serials) serials.insert(serial);
    RIGCAL_RETURN_IF_ERROR(denied.Deny(replaced.uri, serials, now));
  }
  result.joined_since = since.joined;
  RIGCAL_RETURN_IF_ERROR(CloseTokens(before, restored, &result.closed_tokens));
  RIGCAL_RETURN_IF_ERROR(EndWebSessions(
      before / "web_sessions.json", restored / "web_sessions.json", &result.ended_web_sessions));
  return result;
}

}  // namespace rigcal::server
