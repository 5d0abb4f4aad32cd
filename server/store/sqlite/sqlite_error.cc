// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/sqlite_error.h"

#include <sqlite3.h>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

int PrimaryCode(const SQLite::Exception& error) { return error.getErrorCode() & 0xff; }

// Growing the shared index of the write-ahead log fails with an I/O code when the disk is full.
bool IsDiskFull(const SQLite::Exception& error) {
  return PrimaryCode(error) == SQLITE_FULL || error.getExtendedErrorCode() == SQLITE_IOERR_SHMSIZE;
}

}  // namespace

bool IsDiskFailure(const SQLite::Exception& error) {
  return PrimaryCode(error) == SQLITE_IOERR && !IsDiskFull(error);
}

absl::Status StatusFromSqlite(const SQLite::Exception& error, std::string_view what) {
  const std::string reason = absl::StrCat(std::string(what), ": ", error.what(), " (SQLite error ",
                                          error.getExtendedErrorCode(), ")");
  if (IsDiskFull(error)) {
    return absl::ResourceExhaustedError(
        absl::StrCat(reason, "; the disk is full: free space or delete sessions"));
  }
  switch (PrimaryCode(error)) {
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return absl::DataLossError(absl::StrCat(
          reason,
          "; the database is damaged: stop the server, keep a copy of the data directory, "
          "and restore a backup or recover it with `sqlite3 rigcal.db .recover`"));
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return absl::UnavailableError(
          absl::StrCat(reason, "; another program holds the database: close it"));
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_READONLY:
      return absl::FailedPreconditionError(
          absl::StrCat(reason, "; check that the data directory and its files can be written"));
    default:
      return absl::InternalError(reason);
  }
}

}  // namespace rigcal::server
