// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

inline constexpr uint32_t kSchemaVersion = 7;

// Creates the tables in an empty database, or brings those of versions 3 and 4 up to date, inside a
// transaction of the caller's.
//   FAILED_PRECONDITION  the database is of another program, or of another version of this
//                        one; or it holds what this program has not made (a trigger, a view, a
//                        table), which could run when it is used
//   DATA_LOSS            the identity in it is missing
// `file` is for messages.
absl::Status PrepareSchema(SQLite::Database& database, std::string_view file);

// OK for a database of this version, or a backup of one (with the table kBackupTable); else
// FAILED_PRECONDITION or DATA_LOSS as above. Reads only, and nothing but the schema.
absl::Status CheckSchema(SQLite::Database& database, std::string_view file);

// Of a backup: the files that were beside the database.
inline constexpr char kBackupTable[] = R"sql(
CREATE TABLE backup_file(
  path TEXT PRIMARY KEY,
  body BLOB NOT NULL,
  checksum INTEGER NOT NULL
) WITHOUT ROWID;
)sql";

// The identity made by PrepareSchema.
absl::StatusOr<std::string> ReadServerId(SQLite::Database& database);

}  // namespace rigcal::server
