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

// Reading for replica.h. Throw the database's errors.

// How often a standby has taken over.
inline constexpr char kGenerationCounter[] = "takeover";

// Never below 1.
uint64_t ReadGeneration(SqlDatabase& database);
ReplicaListing ListReplica(SqlDatabase& database);
std::vector<StreamProgress> ReadReplicaProgress(SqlDatabase& database, const std::string& id);
// Of all streams of a session.
std::vector<ReplicaStream> ReadReplicaStreams(SqlDatabase& database, const std::string& id);

// What the tables hold of a record. Tables with many rows are left out while a session captures.
std::vector<ReplicaDigest> DigestReplica(SqlDatabase& database, ReplicaKind kind,
                                         const std::string& id);

// One record, in several reads of the store; NOT_FOUND: there is none.
absl::StatusOr<std::vector<ReplicaDigest>> ReadReplica(
    SqlReader& reader, ReplicaKind kind, const std::string& id, std::vector<ReplicaStream> streams,
    const std::function<absl::Status(std::vector<ReplicaRows>)>& take);

}  // namespace rigcal::server
