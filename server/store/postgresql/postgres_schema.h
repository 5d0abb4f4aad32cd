// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/postgresql/postgres_connection.h"

namespace rigcal::server {

inline constexpr int64_t kPostgresSchemaVersion = 2;

// Creates the tables in an empty database, or brings those of an earlier version up to date, in one
// transaction. May throw PostgresError.
//   FAILED_PRECONDITION  the database holds tables of another program, or those of a newer
//                        rigcal-server
//   DATA_LOSS            the identity in it is missing
absl::Status PreparePostgresSchema(PostgresConnection& connection);

// OK for a database of this version; reads only. FAILED_PRECONDITION, DATA_LOSS as above, and
// NOT_FOUND: the database is empty.
absl::Status CheckPostgresSchema(PostgresConnection& connection);

// The identity made by PreparePostgresSchema.
std::string ReadPostgresServerId(PostgresConnection& connection);

}  // namespace rigcal::server
