// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/database_check.h"

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_schema.h"

namespace rigcal::server {
namespace {

// For SQLite's own check.
constexpr int kMaxStructureFaults = 100;
constexpr int kBusyTimeoutOfCheckMs = 10'000;

void CheckStructure(SQLite::Database& database, DatabaseReport* report) {
  try {
    SQLite::Statement integrity(database,
                                absl::StrCat("PRAGMA integrity_check(", kMaxStructureFaults, ")"));
    while (integrity.executeStep()) {
      const std::string line = integrity.getColumn(0).getString();
      if (line != "ok") report->AddFault("the structure of the database is damaged: " + line);
    }
    SQLite::Statement keys(database, "PRAGMA foreign_key_check");
    while (keys.executeStep()) {
      report->AddFault(
          absl::StrCat("a row of table ", keys.getColumn(0).getString(), " belongs to nothing"));
    }
  } catch (const SQLite::Exception& error) {
    report->AddFault(std::string(StatusFromSqlite(error, "reading the structure").message()));
  }
}

}  // namespace

absl::StatusOr<DatabaseReport> CheckDatabase(const std::filesystem::path& file,
                                             const CareProgress& progress) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) {
    return absl::NotFoundError(absl::StrCat("there is no database ", file.string()));
  }
  try {
    SQLite::Database database(file.string(), SQLite::OPEN_READONLY, kBusyTimeoutOfCheckMs);
    DistrustSchema(database);
    database.exec("PRAGMA mmap_size=0; PRAGMA cell_size_check=ON");
    // One state for all that is read. Ends with the connection: after damage it cannot be ended
    // in an orderly way.
    database.exec("BEGIN");
    RIGCAL_RETURN_IF_ERROR(CheckSchema(database, file.string()));
    DatabaseReport report;
    CheckStructure(database, &report);
    SqliteDatabase tables(database);
    CheckTables(tables, progress, &report);
    return report;
  } catch (const SQLite::Exception& error_of_sqlite) {
    return StatusFromSqlite(error_of_sqlite, absl::StrCat("checking ", file.string()));
  }
}

}  // namespace rigcal::server
