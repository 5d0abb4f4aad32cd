// SPDX-License-Identifier: Apache-2.0
#include "server/identity/web_sessions.h"

#include <algorithm>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "server/identity/json_fields.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxSessions = 1000;
constexpr size_t kSecretBytes = 32;

std::string CookieHash(std::string_view bytes) { return absl::BytesToHexString(Sha256(bytes)); }

IdentityJson ToJson(const WebSession& session) {
  return {{"token_id", session.token_id},
          {"role", RoleName(session.role)},
          {"name", session.name},
          {"created", JsonTime(session.created)},
          {"expires", JsonTime(session.expires)},
          {"secret_sha256", session.secret_sha256}};
}

std::optional<WebSession> SessionFromJson(const IdentityJson& json) {
  JsonFields fields(json);
  WebSession session{.token_id = fields.Text("token_id"),
                     .name = fields.Text("name"),
                     .created = fields.Time("created"),
                     .expires = fields.Time("expires"),
                     .secret_sha256 = fields.Text("secret_sha256")};
  const std::optional<Role> role = RoleFromName(fields.Text("role"));
  if (!fields.good() || !role) return std::nullopt;
  session.role = *role;
  return session;
}

}  // namespace

absl::StatusOr<WebSessions> WebSessions::Open(std::filesystem::path file) {
  WebSessions sessions(std::move(file));
  const absl::StatusOr<std::string> text = ReadSmallFile(sessions.file_);
  if (absl::IsNotFound(text.status())) return sessions;
  if (!text.ok()) return text.status();
  const auto json = ParseJson<IdentityJson>(*text);
  bool good = json.is_object() && json.contains("sessions") && json["sessions"].is_array();
  if (good) {
    for (const IdentityJson& entry : json["sessions"]) {
      const std::optional<WebSession> session = SessionFromJson(entry);
      good = good && session.has_value();
      if (session) sessions.sessions_.push_back(*session);
    }
  }
  if (good) return sessions;
  return absl::DataLossError(absl::StrCat(sessions.file_.string(),
                                          " is damaged; remove it: browsers that have signed in "
                                          "must do so again, and nothing else is lost"));
}

absl::Status WebSessions::Save(std::vector<WebSession> sessions) {
  IdentityJson list = IdentityJson::array();
  for (const WebSession& session : sessions) list.push_back(ToJson(session));
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(file_, IdentityJson{{"sessions", list}}.dump(1) + "\n"));
  sessions_ = std::move(sessions);
  return absl::OkStatus();
}

absl::StatusOr<std::string> WebSessions::Create(WebSession session, absl::Time now) {
  std::vector<WebSession> sessions = sessions_;
  std::erase_if(sessions, [&](const WebSession& old) { return old.expires <= now; });
  if (sessions.size() >= kMaxSessions) {
    return absl::ResourceExhaustedError(
        absl::StrCat(kMaxSessions, " browsers have signed in; revoke those that are gone: rigcal ",
                     "token list, rigcal token revoke ID"));
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::string bytes, RandomBytes(kSecretBytes));
  std::string secret = absl::WebSafeBase64Escape(bytes);
  session.secret_sha256 = CookieHash(secret);
  sessions.push_back(std::move(session));
  RIGCAL_RETURN_IF_ERROR(Save(std::move(sessions)));
  return secret;
}

std::optional<WebSession> WebSessions::Find(std::string_view secret, absl::Time now) const {
  // Hashes are compared: how long that takes tells nothing about the secret.
  const auto found = std::ranges::find(sessions_, CookieHash(secret), &WebSession::secret_sha256);
  if (found == sessions_.end() || found->expires <= now) return std::nullopt;
  return *found;
}

absl::StatusOr<size_t> WebSessions::RemoveIf(
    const std::function<bool(const WebSession&)>& matches) {
  std::vector<WebSession> sessions = sessions_;
  const size_t count = std::erase_if(sessions, matches);
  if (count > 0) RIGCAL_RETURN_IF_ERROR(Save(std::move(sessions)));
  return count;
}

absl::Status WebSessions::Remove(std::string_view secret) {
  const std::string hash = CookieHash(secret);
  return RemoveIf([&](const WebSession& session) { return session.secret_sha256 == hash; })
      .status();
}

}  // namespace rigcal::server
