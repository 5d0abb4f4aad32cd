// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_start_check.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr int kOldestVersion = 130000;

absl::Status Refused(const PostgresConnection& connection, std::string_view why) {
  return absl::FailedPreconditionError(
      absl::StrCat(connection.place(), " is not used: ", std::string(why)));
}

std::string Setting(PostgresConnection& connection, const std::string& name) {
  return connection.Run(absl::StrCat("SELECT current_setting('", name, "')")).at(0).at(0);
}

absl::Status PoolerFound(const PostgresConnection& connection) {
  return Refused(connection, kPoolerAdvice);
}

}  // namespace

absl::Status CheckPostgresServer(PostgresConnection& connection,
                                 const PostgresStartOptions& options) {
  if (PQserverVersion(connection.handle()) < kOldestVersion) {
    return Refused(connection,
                   absl::StrCat("it is PostgreSQL ", Setting(connection, "server_version"),
                                ", and version 13 is the oldest that works; upgrade it "
                                "(Debian 12 has 15)"));
  }
  if (connection.Run("SELECT pg_is_in_recovery()").at(0).at(0) == "t") {
    return Refused(connection,
                   "it is a standby in recovery, which can only be read; name the primary, or all "
                   "hosts with commas between (postgresql://USER@HOST1,HOST2/DATABASE), of which "
                   "the one that can be written is taken");
  }
  if (Setting(connection, "transaction_read_only") == "on") {
    return Refused(connection,
                   "its transactions can only read (default_transaction_read_only is on for this "
                   "user or database); turn that off");
  }
  if (Setting(connection, "server_encoding") != "UTF8") {
    return Refused(connection,
                   absl::StrCat("its text is ", Setting(connection, "server_encoding"),
                                "; create a database with `createdb -T template0 -E UTF8`"));
  }
  for (const char* setting : {"fsync", "full_page_writes"}) {
    if (options.unsafe || Setting(connection, setting) != "off") continue;
    return Refused(connection,
                   absl::StrCat("its server has ", setting,
                                " = off, so that a failure of its power can lose what was "
                                "acknowledged or damage the database; turn it on in "
                                "postgresql.conf and restart it, or start with --store-unsafe for "
                                "data that may be lost"));
  }
  return absl::OkStatus();
}

absl::Status ConnectToPostgres(const PostgresStartOptions& options, PostgresDatabase* database) {
  const absl::Status connected = database->Connect();
  try {
    if (connected.ok()) return CheckPostgresServer(database->connection(), options);
    // Of a standby libpq says only that it can be read, as one of several reasons.
    PostgresDatabase any(database->address().With("target_session_attrs", "any"));
    if (!any.Connect().ok()) return connected;
    RIGCAL_RETURN_IF_ERROR(CheckPostgresServer(any.connection(), options));
    return connected;
  } catch (const PostgresError& error) {
    return connected.ok() ? database->StatusOf(error, "looking at the database") : connected;
  }
}

absl::Status CheckNoTransactionPooler(PostgresConnection& writer, PostgresConnection& reader) {
  // Without a pooler the process that was named when the connection began is the one that works.
  const std::string before = writer.Run("SELECT pg_backend_pid()").at(0).at(0);
  if (before == absl::StrCat(PQbackendPID(writer.handle()))) return absl::OkStatus();
  // In a transaction of the reader's, a pooler has given it the session that the writer had, if
  // they share them.
  writer.Run("SELECT set_config('rigcal.probe', 'writer', false)");
  reader.Run("BEGIN");
  const std::string in_reader =
      reader.Run("SELECT coalesce(current_setting('rigcal.probe', true), '')").at(0).at(0);
  const std::string after = writer.Run("SELECT pg_backend_pid()").at(0).at(0);
  reader.Run("COMMIT");
  if (in_reader == "writer" || after != before) return PoolerFound(writer);
  return absl::OkStatus();
}

}  // namespace rigcal::server
