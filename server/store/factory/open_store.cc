// SPDX-License-Identifier: Apache-2.0
#include "server/store/factory/open_store.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/postgresql/postgres_address.h"
#include "server/store/postgresql/postgres_job_store.h"
#include "server/store/postgresql/postgres_roster.h"
#include "server/store/postgresql/postgres_store.h"
#include "server/store/sqlite/sqlite_store.h"

namespace rigcal::server {
namespace {

struct KindAndPlace {
  std::string kind = "sqlite";
  std::string place;
};

KindAndPlace Split(const std::string& location) {
  const size_t colon = location.find(':');
  // "./a:b" is a path, "a:b" is not.
  if (colon == std::string::npos || colon > location.find('/')) return {.place = location};
  return {.kind = location.substr(0, colon), .place = location.substr(colon + 1)};
}

absl::StatusOr<std::unique_ptr<SqlStore>> OpenSqlStore(const std::string& location,
                                                       const StoreOptions& options) {
  if (PostgresAddress::Is(location)) {
    return PostgresStore::Open({.url = location,
                                .writer = {.start = {.unsafe = options.unsafe},
                                           .server = options.server,
                                           .silent_owner = options.silent_owner}});
  }
  const auto [kind, place] = Split(location);
  if (kind == "sqlite") {
    return SqliteStore::Open({.data_directory = place, .min_free_bytes = options.min_free_bytes});
  }
  return absl::InvalidArgumentError(absl::StrCat("'", location, "': unknown kind of store '", kind,
                                                 "'; known: sqlite, postgresql://... (write ./",
                                                 location, " for a folder of that name)"));
}

// Opening one would create it.
absl::Status CheckThereIsAStore(const std::string& location) {
  const auto [kind, place] = Split(location);
  std::error_code error;
  if (IsDatabaseAddress(location) || kind != "sqlite" ||
      std::filesystem::exists(std::filesystem::path(place) / "rigcal.db", error)) {
    return absl::OkStatus();
  }
  return absl::NotFoundError(absl::StrCat("there is no database in ", place));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> OpenStore(const std::string& location,
                                                 const StoreOptions& options) {
  return OpenSqlStore(location, options);
}

absl::StatusOr<std::unique_ptr<ServerRoster>> OpenServerRoster(const std::string& location,
                                                               const StoreOptions& options,
                                                               ServerEntry own) {
  if (!PostgresAddress::Is(location)) return nullptr;
  RIGCAL_ASSIGN_OR_RETURN(const PostgresAddress address, PostgresAddress::Parse(location));
  return PostgresRoster::Open(address, {.unsafe = options.unsafe}, std::move(own));
}

absl::StatusOr<std::unique_ptr<Store>> OpenJobStore(const std::string& location) {
  if (PostgresAddress::Is(location)) return PostgresJobStore::Open(location);
  return absl::InvalidArgumentError(absl::StrCat(
      "'", location,
      "': rigcal-worker takes calibrations from a PostgreSQL database, "
      "postgresql://USER@HOST/DATABASE. An SQLite database is a file of one PC that one server "
      "has open; that server solves its calibrations itself. `rigcal-server store copy` moves it "
      "to PostgreSQL"));
}

bool IsDatabaseAddress(const std::string& location) { return PostgresAddress::Is(location); }

std::string PrintableLocation(const std::string& location) {
  if (!IsDatabaseAddress(location)) return location;
  const auto address = PostgresAddress::Parse(location);
  return address.ok() ? address->text() : "a database whose address cannot be read";
}

absl::StatusOr<std::vector<CopiedTable>> CopyStore(const std::string& from, const std::string& to,
                                                   const StoreOptions& options) {
  RIGCAL_RETURN_IF_ERROR(CheckThereIsAStore(from));
  RIGCAL_ASSIGN_OR_RETURN(const auto source, OpenSqlStore(from, options));
  RIGCAL_ASSIGN_OR_RETURN(const auto destination, OpenSqlStore(to, options));
  return destination->CopyFrom(*source);
}

}  // namespace rigcal::server
