// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/sqlite/database_check.h"

namespace rigcal::server {

// Copies the database of a data directory and its small files (the keys and certificates in
// `identity`, audit.jsonl) into `file`, one SQLite database of mode 0600. Only reads the directory,
// in one consistent state: a server may run on it. The copy is checked before it gets its name;
// what is damaged in it is in the report.
//   NOT_FOUND            the directory has no database
//   ALREADY_EXISTS       `file` exists
//   RESOURCE_EXHAUSTED   the disk of `file` is full
//   FAILED_PRECONDITION  `file` cannot be written, or the database is of another program or version
//   DATA_LOSS            the database is so damaged that it cannot be copied
absl::StatusOr<DatabaseReport> BackUpDatabase(const std::filesystem::path& data_directory,
                                              const std::filesystem::path& file,
                                              const CareProgress& progress);

// What a restore has done.
struct RestoreReport {
  DatabaseReport backup;
  std::filesystem::path kept;  // the data directory as it was before; empty: there was none
};

struct RestoreOptions {
  bool take_damaged = false;
  // Called with the directory before and the one that will take its place, when that has all its
  // files; what it returns ends the restore. Empty: nothing is called.
  std::function<absl::Status(const std::filesystem::path& before,
                             const std::filesystem::path& restored)>
      reconcile = {};
};

// Puts a backup in the place of a data directory, which is moved aside. What the backup does not
// have (`identity`, of a backup by hand) is taken from the directory before.
//   NOT_FOUND            there is no such backup
//   FAILED_PRECONDITION  a server uses the directory; the file is no backup of this version; the
//                        directory cannot be moved
//   DATA_LOSS            the backup is damaged, and take_damaged is not set; the first fault is
//                        named
absl::StatusOr<RestoreReport> RestoreDatabase(const std::filesystem::path& file,
                                              const std::filesystem::path& data_directory,
                                              const RestoreOptions& options,
                                              const CareProgress& progress);

}  // namespace rigcal::server
