// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/database_backup.h"

#include <SQLiteCpp/Backup.h>
#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <algorithm>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"
#include "server/store/record_checksum.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_schema.h"

namespace rigcal::server {
namespace {

namespace fs = std::filesystem;

constexpr int kStepPages = 1024;
// The largest, audit.jsonl, is cut long before.
constexpr size_t kMaxSmallFile = size_t{1} << 30;
// Copying is this part of the work, checking the copy the rest.
constexpr double kCopyPart = 0.6;

CareProgress PartOf(const CareProgress& progress, double from, double to) {
  return [progress, from, to](double fraction) { progress(from + (to - from) * fraction); };
}

// Keys, certificates, who owns which camera and the like, which are beside the database.
std::vector<fs::path> SmallFiles(const fs::path& data_directory) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const char* name : {"agents.json", "monitors.json", "audit.jsonl"}) {
    if (fs::exists(data_directory / name, error)) files.emplace_back(name);
  }
  for (fs::directory_iterator entry(data_directory / "identity", error), end;
       !error && entry != end; entry.increment(error)) {
    if (fs::is_regular_file(entry->symlink_status(error)))
      files.push_back("identity" / entry->path().filename());
  }
  return files;
}

void CopyDatabase(SQLite::Database& source, SQLite::Database& copy, const CareProgress& progress) {
  // The transaction keeps the state: otherwise each write of a server would start the copy anew.
  SQLite::Transaction transaction(source);
  source.execAndGet("SELECT count(*) FROM identity");  // from here on
  SQLite::Backup backup(copy, source);
  for (int result = SQLITE_OK; result != SQLITE_DONE;) {
    result = backup.executeStep(kStepPages);
    const int total = std::max(1, backup.getTotalPageCount());
    progress(1 - static_cast<double>(backup.getRemainingPageCount()) / total);
  }
}

absl::Status AddSmallFiles(const fs::path& data_directory, SQLite::Database& copy) {
  SQLite::Transaction transaction(copy);
  copy.exec(kBackupTable);
  SqliteDatabase tables(copy);
  SqlStatement insert(tables, "INSERT INTO backup_file(path, body, checksum) VALUES(?,?,?)");
  for (const fs::path& name : SmallFiles(data_directory)) {
    RIGCAL_ASSIGN_OR_RETURN(const std::string body,
                            ReadWholeFile(data_directory / name, kMaxSmallFile));
    Execute(insert, name.string(), Blob{body}, Checksum(body));
  }
  transaction.commit();
  return absl::OkStatus();
}

absl::Status WriteCopy(const fs::path& data_directory, const fs::path& copy_file,
                       const CareProgress& progress) {
  const fs::path database = data_directory / "rigcal.db";
  try {
    SQLite::Database source(database.string(), SQLite::OPEN_READONLY, 10'000);
    DistrustSchema(source);
    RIGCAL_RETURN_IF_ERROR(CheckSchema(source, database.string()));
    SQLite::Database copy(copy_file.string(), SQLite::OPEN_READWRITE, 10'000);
    DistrustSchema(copy);
    CopyDatabase(source, copy, progress);
    // One file, without a log beside it.
    copy.exec("PRAGMA journal_mode=DELETE; PRAGMA synchronous=FULL");
    return AddSmallFiles(data_directory, copy);
  } catch (const SQLite::Exception& error) {
    return StatusFromSqlite(error, absl::StrCat("backing up ", database.string()));
  }
}

}  // namespace

absl::StatusOr<DatabaseReport> BackUpDatabase(const fs::path& data_directory, const fs::path& file,
                                              const CareProgress& progress) {
  std::error_code error;
  if (!fs::exists(data_directory / "rigcal.db", error)) {
    return absl::NotFoundError(absl::StrCat("there is no database in ", data_directory.string()));
  }
  if (fs::exists(file, error)) {
    return absl::AlreadyExistsError(
        absl::StrCat(file.string(), " exists; give another name, or remove it"));
  }
  const fs::path part = file.string() + ".part";
  fs::remove(part, error);
  RIGCAL_RETURN_IF_ERROR(CreatePrivateFile(part));
  absl::Status status = WriteCopy(data_directory, part, PartOf(progress, 0, kCopyPart));
  absl::StatusOr<DatabaseReport> report = absl::InternalError("");
  if (status.ok()) {
    report = CheckDatabase(part, PartOf(progress, kCopyPart, 1));
    status = report.status();
  }
  if (status.ok()) status = SyncAndRename(part, file);
  if (!status.ok()) {
    fs::remove(part, error);
    return status;
  }
  return report;
}

}  // namespace rigcal::server
