// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"
#include "server/store/postgresql/postgres_connection.h"
#include "server/store/postgresql/postgres_database.h"

namespace rigcal::server {

struct PostgresStartOptions {
  // Take a database server that can lose what it has acknowledged, or damage its files, when its
  // power fails.
  bool unsafe = false;
};

// Whether a database server keeps what this program promises. FAILED_PRECONDITION: it is older than
// PostgreSQL 13, it only reads (a standby in recovery), it does not write through to its disk
// (fsync, full_page_writes), or its text is not UTF-8; the message says what to do. May throw
// PostgresError.
absl::Status CheckPostgresServer(PostgresConnection& connection,
                                 const PostgresStartOptions& options);

// Whether both connections keep their session between transactions. FAILED_PRECONDITION: a pooler
// gives each transaction another one. May throw PostgresError.
absl::Status CheckNoTransactionPooler(PostgresConnection& writer, PostgresConnection& reader);

// Connects, and checks the server. The errors of PostgresConnection::Open and CheckPostgresServer.
absl::Status ConnectToPostgres(const PostgresStartOptions& options, PostgresDatabase* database);

}  // namespace rigcal::server
