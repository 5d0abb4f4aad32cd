// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string_view>

#include "absl/status/status.h"

namespace rigcal::server {

// The status for an error of SQLite; `what` begins the message: "storing observations".
//   RESOURCE_EXHAUSTED  the disk is full
//   DATA_LOSS           the database is damaged, or the file is no database
//   UNAVAILABLE         locked by another program
//   INTERNAL            anything else, errors of the disk among them
absl::Status StatusFromSqlite(const SQLite::Exception& error, std::string_view what);

// The disk failed to read, write or sync: what the database holds in memory and what is on the disk
// may differ from now on.
bool IsDiskFailure(const SQLite::Exception& error);

}  // namespace rigcal::server
