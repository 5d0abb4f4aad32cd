// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

inline constexpr uint32_t kSchemaVersion = 5;

// Creates the tables in an empty database, or brings those of versions 3 and 4 up to date, inside a
// transaction of the caller's.
//   FAILED_PRECONDITION  the database is of another program, or of another version of this one
//   DATA_LOSS            the identity in it is missing
// `file` is for messages.
absl::Status PrepareSchema(SQLite::Database& database, std::string_view file);

// OK for a database of this version; else FAILED_PRECONDITION or DATA_LOSS as above. Reads only.
absl::Status CheckSchema(SQLite::Database& database, std::string_view file);

// The identity made by PrepareSchema.
absl::StatusOr<std::string> ReadServerId(SQLite::Database& database);

// Adds one to a persisted counter ("session", "calibration") and returns it; never the same twice.
uint32_t NextNumber(SQLite::Database& database, std::string_view counter);

}  // namespace rigcal::server
