// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/replica.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {

// Storing for replica.h, in a transaction of the caller's. Throw the database's errors.

// Rows of records that changed at the primary replace those here, rows of tables that only grow are
// added. Compared by digests at the end. DATA_LOSS names the table that differs.
absl::Status WriteRecord(
    SqlDatabase& database, ReplicaKind kind, const std::string& id,
    const std::function<absl::StatusOr<std::vector<ReplicaDigest>>(const ReplicaTarget::TakeRows&)>&
        read);

// Everything of a record. Does nothing for what is of no record.
void EraseRecord(SqlDatabase& database, ReplicaKind kind, const std::string& id);

}  // namespace rigcal::server
