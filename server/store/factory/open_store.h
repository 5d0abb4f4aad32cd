// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/store/server_roster.h"
#include "server/store/sql/table_copy.h"
#include "server/store/store.h"

namespace rigcal::server {

struct StoreOptions {
  // Observations are refused while the disk has less room than this.
  uint64_t min_free_bytes = uint64_t{256} << 20;
  // Take a PostgreSQL server that does not write through to its disk.
  bool unsafe = false;
  // Where several servers share the store: ServerEntry::id of this one, and the silent owner that
  // the roster has found.
  std::string server = {};
  int64_t silent_owner = 0;
};

// Opens the store at `location`, KIND:PLACE, or a folder's path alone for the default kind. Kinds:
//   sqlite:FOLDER  one SQLite database in the folder, created where it is missing (the default)
//   postgresql://USER@HOST/DATABASE  a PostgreSQL database of this server's own
// INVALID_ARGUMENT: an unknown kind; the known ones are named. Else as the Open of that kind.
//
// Another kind of store is a folder beside this one and a line in open_store.cc.
absl::StatusOr<std::unique_ptr<Store>> OpenStore(const std::string& location,
                                                 const StoreOptions& options = {});

// The servers that share the store at `location`, with this one in it. Null: it is of a kind that
// one server has for itself. Errors as OpenStore, except that another server may use it.
absl::StatusOr<std::unique_ptr<ServerRoster>> OpenServerRoster(const std::string& location,
                                                               const StoreOptions& options,
                                                               ServerEntry own);

// Opens the store at `location` beside the server that uses it, to take jobs from it.
// INVALID_ARGUMENT: it is no database of several processes; else as PostgresJobStore::Open.
absl::StatusOr<std::unique_ptr<Store>> OpenJobStore(const std::string& location);

// A location as messages may show it: without a password.
std::string PrintableLocation(const std::string& location);

// The location is a database elsewhere, so that a server needs a folder beside it.
bool IsDatabaseAddress(const std::string& location);

// Copies everything from one store to another one, of any kinds, which must be empty; no server may
// use either. Errors as OpenStore and SqlStore::CopyFrom; NOT_FOUND: there is no store at `from`.
absl::StatusOr<std::vector<CopiedTable>> CopyStore(const std::string& from, const std::string& to,
                                                   const StoreOptions& options = {});

}  // namespace rigcal::server
