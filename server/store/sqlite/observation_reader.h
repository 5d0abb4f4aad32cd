// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/store.h"

namespace rigcal::server {

// Store::ReadObservations. Reads in short pieces; `visit` is called between them, with no lock
// held.
absl::Status ReadObservations(SqliteReader& reader, std::string_view session_id,
                              std::string_view camera,
                              const std::function<absl::Status(StoredBatch)>& visit);

// Store::GetStream, inside a Read. May throw SQLite::Exception.
absl::StatusOr<StreamStatus> ReadStreamStatus(SQLite::Database& database, const StreamKey& stream);

}  // namespace rigcal::server
