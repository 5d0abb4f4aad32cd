// SPDX-License-Identifier: Apache-2.0
#include <SQLiteCpp/SQLiteCpp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/file/private_folder.h"
#include "common/status/status_macros.h"
#include "server/store/record_checksum.h"
#include "server/store/data_directory.h"
#include "server/store/sqlite/database_backup.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_schema.h"

namespace rigcal::server {
namespace {

namespace fs = std::filesystem;

absl::Status FolderError(const std::string& what, const fs::path& folder,
                         const std::error_code& error) {
  return absl::FailedPreconditionError(
      absl::StrCat(what, " ", folder.string(), ": ", error.message()));
}

// "rigcal.before-restore-20260131T235959"
fs::path AsideName(const fs::path& folder) {
  char text[32] = {};
  const std::time_t now = std::time(nullptr);
  std::tm parts = {};
  std::strftime(text, sizeof(text), "%Y%m%dT%H%M%S", gmtime_r(&now, &parts));
  fs::path aside = folder.string() + ".before-restore-" + text;
  std::error_code error;
  for (int i = 2; fs::exists(aside, error); ++i) {
    aside = absl::StrCat(folder.string(), ".before-restore-", text, "-", i);
  }
  return aside;
}

// A path as it may be in a backup: never out of the data directory.
bool IsSafe(const fs::path& path) {
  if (path.empty() || path.is_absolute()) return false;
  for (const fs::path& part : path) {
    if (part == "..") return false;
  }
  return true;
}

// Writes the small files of a backup, and makes the backup a plain database again.
absl::Status UnpackSmallFiles(const fs::path& folder) {
  try {
    SQLite::Database database((folder / "rigcal.db").string(), SQLite::OPEN_READWRITE, 10'000);
    DistrustSchema(database);
    RIGCAL_RETURN_IF_ERROR(CheckSchema(database, "the backup"));
    if (!database.tableExists("backup_file")) return absl::OkStatus();
    SqliteDatabase tables(database);
    SqlStatement row(tables, "SELECT path, body, checksum FROM backup_file");
    while (row.Step()) {
      const fs::path path = row.Text(0);
      const std::string_view body = row.Bytes(1);
      if (!IsSafe(path) || Checksum(body) != row.Uint32(2)) {
        return absl::DataLossError(
            absl::StrCat("the file ", path.string(), " in the backup is damaged"));
      }
      if (path.has_parent_path()) mkdir((folder / path.parent_path()).c_str(), 0700);
      RIGCAL_RETURN_IF_ERROR(CreatePrivateFile(folder / path, body));
    }
    row.Reset();
    database.exec("DROP TABLE backup_file");
    return absl::OkStatus();
  } catch (const SQLite::Exception& error) {
    return StatusFromSqlite(error, "unpacking the backup");
  }
}

absl::Status CopyDatabaseFile(const fs::path& file, const fs::path& folder) {
  std::error_code error;
  RIGCAL_RETURN_IF_ERROR(CreatePrivateFile(folder / "rigcal.db"));
  fs::copy_file(file, folder / "rigcal.db", fs::copy_options::overwrite_existing, error);
  if (error) {
    if (error == std::errc::no_space_on_device) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the disk of ", folder.string(), " has no room for the backup; free space"));
    }
    return FolderError("copying the backup to", folder, error);
  }
  chmod((folder / "rigcal.db").c_str(), 0600);
  return absl::OkStatus();
}

// The new data directory, beside the old one.
absl::Status FillFolder(const fs::path& file, const fs::path& old_folder, const fs::path& folder) {
  if (mkdir(folder.c_str(), 0700) != 0) {
    return FolderError("creating", folder, {errno, std::generic_category()});
  }
  RIGCAL_RETURN_IF_ERROR(CopyDatabaseFile(file, folder));
  RIGCAL_RETURN_IF_ERROR(UnpackSmallFiles(folder));
  std::error_code error;
  for (const char* name : {"identity", "agents.json", "monitors.json", "audit.jsonl"}) {
    if (fs::exists(folder / name, error) || !fs::exists(old_folder / name, error)) continue;
    fs::copy(old_folder / name, folder / name, fs::copy_options::recursive, error);
    if (error) return FolderError("copying from", old_folder / name, error);
    RIGCAL_RETURN_IF_ERROR(CloseToOthers(folder / name).status());
  }
  return SyncAndRename(folder / "rigcal.db", folder / "rigcal.db");
}

absl::Status SwapFolders(const fs::path& folder, const fs::path& aside, const fs::path& filled) {
  std::error_code error;
  fs::rename(folder, aside, error);
  if (error) {
    return absl::FailedPreconditionError(absl::StrCat(
        "cannot move ", folder.string(), " aside to ", aside.string(), ": ", error.message(),
        "; where it is a mount point, restore into another folder with --data-dir"));
  }
  fs::rename(filled, folder, error);
  if (error) {
    std::error_code ignored;
    fs::rename(aside, folder, ignored);
    return FolderError("naming the restored folder", folder, error);
  }
  return SyncFolder(fs::absolute(folder).parent_path());
}

}  // namespace

absl::StatusOr<RestoreReport> RestoreDatabase(const fs::path& file, const fs::path& data_directory,
                                              const RestoreOptions& options,
                                              const CareProgress& progress) {
  std::error_code error;
  const fs::path whole = fs::absolute(data_directory).lexically_normal();
  const fs::path folder = whole.has_filename() ? whole : whole.parent_path();
  RestoreReport report;
  const bool had_folder = fs::exists(folder, error);
  const bool had_files = fs::is_directory(folder, error) && !fs::is_empty(folder, error);
  // Held until the end: no server starts on a folder that is being replaced. First of all, because
  // where one runs there is no use in checking the backup.
  RIGCAL_ASSIGN_OR_RETURN(const auto lock, DataDirectory::Open(folder));
  const auto give_up = [&](absl::Status status) {
    if (!had_folder) fs::remove_all(folder, error);  // was made for the lock only
    return status;
  };
  absl::StatusOr<DatabaseReport> backup = CheckDatabase(file, progress);
  if (!backup.ok()) return give_up(backup.status());
  report.backup = *std::move(backup);
  if (report.backup.fault_count > 0 && !options.take_damaged) {
    return give_up(absl::DataLossError(
        absl::StrCat(file.string(), " has ", report.backup.fault_count,
                     " faults, the first: ", report.backup.faults.front(),
                     "; take another backup, or give --damaged to restore what it has")));
  }
  const fs::path filled = absl::StrCat(folder.string(), ".restore-", getpid());
  const fs::path aside = AsideName(folder);
  absl::Status status = FillFolder(file, folder, filled);
  if (status.ok() && options.reconcile) status = options.reconcile(folder, filled);
  if (status.ok()) status = SwapFolders(folder, aside, filled);
  if (!status.ok()) {
    fs::remove_all(filled, error);
    return give_up(std::move(status));
  }
  if (had_files) {
    report.kept = aside;
  } else {
    fs::remove_all(aside, error);  // was made for the lock only
  }
  return report;
}

}  // namespace rigcal::server
