// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_address.h"

#include <libpq-fe.h>

#include <memory>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

// In effect unless the address says otherwise.
constexpr std::pair<const char*, const char*> kDefaults[] = {
    {"application_name", "rigcal-server"},
    {"connect_timeout", "5"},  // seconds, for each host
    // A cut cable is noticed after 10 s + 3 * 3 s; unanswered bytes after 15 s.
    {"keepalives_idle", "10"},
    {"keepalives_interval", "3"},
    {"keepalives_count", "3"},
    {"tcp_user_timeout", "15000"},
    {"target_session_attrs", "read-write"},
};

struct FreeOptions {
  void operator()(PQconninfoOption* options) const { PQconninfoFree(options); }
};

}  // namespace

bool PostgresAddress::Is(std::string_view location) {
  return location.starts_with("postgresql://") || location.starts_with("postgres://");
}

absl::StatusOr<PostgresAddress> PostgresAddress::Parse(const std::string& url) {
  // libpq's own message repeats parts of the text, the password among them.
  char* message = nullptr;
  const std::unique_ptr<PQconninfoOption, FreeOptions> parsed(
      PQconninfoParse(url.c_str(), &message));
  if (message != nullptr) PQfreemem(message);
  if (parsed == nullptr || !Is(url)) {
    return absl::InvalidArgumentError(
        "--store: this is no address of a database that can be read; write "
        "postgresql://USER@HOST:PORT/DATABASE, with %XX for special characters (%40 for @, %2F for "
        "/), and options as libpq knows them behind a ?");
  }
  PostgresAddress address;
  std::map<std::string, std::string>& options = address.options_;
  for (const PQconninfoOption* option = parsed.get(); option->keyword != nullptr; ++option) {
    if (option->val != nullptr) options[option->keyword] = option->val;
  }
  for (const auto& [name, value] : kDefaults) options.emplace(name, value);
  options["client_encoding"] = "UTF8";
  const auto part = [&](const char* name) {
    const auto found = options.find(name);
    return found == options.end() ? std::string() : found->second;
  };
  const std::string host = part("host").empty() ? part("hostaddr") : part("host");
  address.text_ = absl::StrCat("postgresql://", part("user"), part("user").empty() ? "" : "@", host,
                               part("port").empty() ? "" : ":", part("port"), "/", part("dbname"));
  return address;
}

PostgresAddress PostgresAddress::With(const std::string& option, const std::string& value) const {
  PostgresAddress changed = *this;
  changed.options_[option] = value;
  return changed;
}

}  // namespace rigcal::server
