// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/identity/role.h"

namespace rigcal::server {

inline constexpr absl::Duration kWebSessionLifetime = absl::Hours(24 * 30);

// A browser that has signed in, as the server keeps it.
struct WebSession {
  std::string token_id = {};  // of the token that it signed in with
  Role role = Role::kViewer;
  std::string name = {};
  absl::Time created = {};
  absl::Time expires = {};
  std::string secret_sha256 = {};  // of its cookie, hexadecimal
};

// Browsers that have signed in, in web_sessions.json; each change is on disk when a function
// returns. Not for several threads.
class WebSessions {
 public:
  // DATA_LOSS: the file is damaged; the message says what to do.
  static absl::StatusOr<WebSessions> Open(std::filesystem::path file);

  // `session` without its secret. Returns the cookie's value, which is kept nowhere.
  // RESOURCE_EXHAUSTED: there are too many.
  absl::StatusOr<std::string> Create(WebSession session, absl::Time now);
  // None: there is no session with this cookie, or it has ended.
  std::optional<WebSession> Find(std::string_view secret, absl::Time now) const;
  // Returns how many there were.
  absl::StatusOr<size_t> RemoveIf(const std::function<bool(const WebSession&)>& matches);
  absl::Status Remove(std::string_view secret);

 private:
  explicit WebSessions(std::filesystem::path file) : file_(std::move(file)) {}

  absl::Status Save(std::vector<WebSession> sessions);

  std::filesystem::path file_;
  std::vector<WebSession> sessions_;
};

}  // namespace rigcal::server
