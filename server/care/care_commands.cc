// SPDX-License-Identifier: Apache-2.0
#include "server/care/care_commands.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"
#include "server/care/running_server.h"
#include "server/identity/restored_identity.h"
#include "server/identity/server_identity.h"
#include "server/rpc/compact_client.h"
#include "server/store/factory/open_store.h"
#include "server/store/postgresql/postgres_store.h"
#include "server/store/sqlite/database_backup.h"
#include "server/store/sqlite/database_check.h"
#include "server/store/sqlite/sqlite_store.h"

namespace rigcal::server {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxPrintedFaults = 100;

int Fail(const absl::Status& status) {
  std::fprintf(stderr, "rigcal-server: %s\n", std::string(status.message()).c_str());
  return 1;
}

// Tells on stderr how far the work is, at every tenth.
CareProgress ProgressOf(std::string what) {
  return [what = std::move(what), told = 0](double fraction) mutable {
    const int tenths = static_cast<int>(std::clamp(fraction, 0.0, 1.0) * 10);
    if (tenths <= told) return;
    told = tenths;
    std::fprintf(stderr, "%s: %d %%\n", what.c_str(), 10 * tenths);
  };
}

std::string CountsText(const DatabaseReport& report) {
  const auto counted = [](uint64_t count, const char* one, const char* many) {
    return absl::StrCat(count, " ", count == 1 ? one : many);
  };
  return absl::StrCat(counted(report.session_count, "session", "sessions"), ", ",
                      counted(report.observation_count, "observation", "observations"), " in ",
                      counted(report.batch_count, "batch", "batches"), ", ",
                      counted(report.calibration_count, "calibration", "calibrations"));
}

void PrintFaults(const DatabaseReport& report) {
  const size_t printed = std::min(report.faults.size(), kMaxPrintedFaults);
  for (size_t i = 0; i < printed; ++i) std::printf("  %s\n", report.faults[i].c_str());
  if (report.fault_count > printed) {
    std::printf("  and %s more\n", absl::StrCat(report.fault_count - printed).c_str());
  }
}

std::string FaultsText(const DatabaseReport& report) {
  return absl::StrCat(report.fault_count, report.fault_count == 1 ? " fault" : " faults", ", ",
                      report.damaged_row_count, " observations lost");
}

// The exit code of a check.
int PrintCheck(const std::string& place, const char* how_to_restore, const DatabaseReport& report) {
  std::printf("%s: %s\n", place.c_str(), CountsText(report).c_str());
  if (report.fault_count == 0) {
    std::printf("no faults\n");
    return 0;
  }
  PrintFaults(report);
  std::printf("%s; everything else can be used. %s if you need what is lost\n",
              FaultsText(report).c_str(), how_to_restore);
  return 1;
}

// Without a server the database is opened here. A running server has the only connection that may
// write, so it does the work.
absl::Status CompactHereOrThere(const std::string& data_directory, const std::string& server,
                                const CareProgress& progress) {
  const auto store = SqliteStore::Open({.data_directory = data_directory});
  if (store.ok()) {
    return (*store)->Compact([&](double fraction) {
      progress(fraction);
      return absl::OkStatus();
    });
  }
  absl::StatusOr<std::string> address = server;
  if (server.empty()) address = AddressOfRunningServer(data_directory);
  if (!absl::IsFailedPrecondition(store.status()) || !address.ok()) return store.status();
  return CompactRunningServer(*address,
                              [&](const CompactProgress& made) { progress(made.fraction); });
}

// Who may talk with a restored server.
void PrintIdentity(const RestoredIdentity& identity) {
  if (!identity.compared) {
    std::printf(
        "there was no list of identities of this server here before, so that of the backup counts: "
        "who was revoked and which join strings were used after it was made is not known. See "
        "`rigcal agent list` and `rigcal token list`, and revoke whom you do not want\n");
    return;
  }
  std::printf(
      "who was revoked, which join strings were used and which browsers signed out since the "
      "backup "
      "stays so");
  if (identity.closed_tokens + identity.ended_web_sessions > 0) {
    const auto count = [](size_t number, const char* singular) {
      return absl::StrCat(number, " ", singular, number == 1 ? "" : "s");
    };
    std::printf(" (%s, %s)", count(identity.closed_tokens, "join string").c_str(),
                count(identity.ended_web_sessions, "browser").c_str());
  }
  std::printf("\n");
  for (const std::string& uri : identity.joined_since) {
    std::printf("%s joined after the backup and is not known any more: it must join again\n",
                PrintableLines(uri).c_str());
  }
}

std::string Megabytes(uint64_t bytes) {
  return absl::StrFormat("%.1f MB", static_cast<double>(bytes) / 1e6);
}

// What a database takes on the disk. Rows are in its log first; without that, moving them into the
// database would look like growth.
uint64_t SizeWithLog(const fs::path& file) {
  uint64_t bytes = 0;
  for (const char* part : {"", "-wal"}) {
    std::error_code error;
    const uintmax_t size = fs::file_size(file.string() + part, error);
    if (!error) bytes += size;
  }
  return bytes;
}

// A file that never was a database. One that is missing is named by who opens it.
bool IsOtherFile(const fs::path& path) {
  constexpr std::string_view kBegin = "SQLite format 3";
  std::ifstream file(path, std::ios::binary);
  if (!file) return false;
  std::string begin(kBegin.size(), '\0');
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return begin != kBegin;
}

}  // namespace

CareCommands::CareCommands(CLI::App* app) {
  app->require_subcommand(0, 1);
  app->fallthrough();
  check_ = app->add_subcommand(
      "check", "Verify all stored data, also while a server runs; exit 1 names what is damaged");
  backup_ = app->add_subcommand(
      "backup", "Copy all data, keys included, into one file, also while a server runs");
  backup_->add_option("file", file_, "File to write; must not exist")
      ->required()
      ->type_name("FILE");
  restore_ = app->add_subcommand(
      "restore",
      "Put a backup in the place of the data, which is moved aside; stop the server first");
  restore_->add_option("file", file_, "A backup")->required()->type_name("FILE");
  restore_->add_flag("--damaged", take_damaged_, "Also restore a backup that is damaged");
  compact_ = app->add_subcommand("compact",
                                 "Give unused space back to the disk, also while a server runs");
  compact_
      ->add_option("--server", server_,
                   "Address of the running server (default: as noted in the data folder)")
      ->type_name("HOST:PORT");
  CLI::App* const store = app->add_subcommand("store", "Move the database");
  store->require_subcommand(1);
  copy_ = store->add_subcommand(
      "copy",
      "Copy sessions, observations and calibrations from one database into an empty one; stop the "
      "server first");
  copy_->add_option("from", from_, "Data folder, or postgresql://USER@HOST/DATABASE")
      ->required()
      ->type_name("FROM");
  copy_->add_option("to", to_, "The same")->required()->type_name("TO");
}

bool CareCommands::chosen() const {
  return check_->parsed() || backup_->parsed() || restore_->parsed() || compact_->parsed() ||
         copy_->parsed();
}

int CareCommands::Run(const std::string& data_directory, const std::string& store) const {
  if (copy_->parsed()) return Copy();
  if (!store.empty()) return RunElsewhere(store);
  if (check_->parsed()) return Check(data_directory);
  if (backup_->parsed()) return BackUp(data_directory);
  if (restore_->parsed()) return Restore(data_directory);
  return Compact(data_directory);
}

int CareCommands::RunElsewhere(const std::string& store) const {
  if (!IsDatabaseAddress(store)) {
    return Fail(absl::InvalidArgumentError(
        "--store is no address of a database: write postgresql://USER@HOST/DATABASE"));
  }
  if (check_->parsed()) return CheckElsewhere(store);
  const std::string place = PrintableLocation(store);
  std::string instead;
  if (backup_->parsed()) {
    instead = absl::StrCat("`pg_dump -F c -f FILE ", place,
                           "` copies it while the server runs (or pgbackrest, continuously); the "
                           "server's keys are in its data folder, in `identity`: copy that too");
  } else if (restore_->parsed()) {
    instead = absl::StrCat("stop the server, and use `pg_restore -c -d ", place, " FILE`");
  } else {
    instead = absl::StrCat(
        "PostgreSQL uses the space of what was deleted again by itself; to give it back to the "
        "disk, stop the server and use `vacuumdb -f -d ",
        place, "`");
  }
  return Fail(absl::FailedPreconditionError(absl::StrCat(
      "the data is in a database of PostgreSQL, which has its own programs for this: ", instead)));
}

int CareCommands::CheckElsewhere(const std::string& store) const {
  const auto report = CheckPostgresDatabase(store, ProgressOf("check"));
  if (!report.ok()) return Fail(report.status());
  return PrintCheck(PrintableLocation(store), "Restore a backup with pg_restore", *report);
}

int CareCommands::Copy() const {
  const auto copied = CopyStore(from_, to_);
  if (!copied.ok()) return Fail(copied.status());
  for (const CopiedTable& table : *copied) {
    if (table.rows == 0) continue;
    std::printf("%-20s %10s rows, CRC-32 %08x on both sides\n", table.name.c_str(),
                absl::StrCat(table.rows).c_str(), table.digest);
  }
  std::printf(
      "copied from %s to %s. Keys, owners of cameras and the audit log are in the server's data "
      "folder and stay there\n",
      PrintableLocation(from_).c_str(), PrintableLocation(to_).c_str());
  return 0;
}

int CareCommands::Check(const std::string& data_directory) const {
  const fs::path file = fs::path(data_directory) / "rigcal.db";
  const auto report = CheckDatabase(file, ProgressOf("check"));
  if (!report.ok()) return Fail(report.status());
  return PrintCheck(file.string(), "Restore a backup with `rigcal-server restore`", *report);
}

int CareCommands::BackUp(const std::string& data_directory) const {
  const auto report = BackUpDatabase(data_directory, file_, ProgressOf("backup"));
  if (!report.ok()) return Fail(report.status());
  std::error_code error;
  std::printf("%s: %s, %s. It holds the server's keys: keep it where only you can read it\n",
              file_.c_str(), CountsText(*report).c_str(),
              Megabytes(fs::file_size(file_, error)).c_str());
  if (report->fault_count > 0) {
    std::fprintf(stderr,
                 "rigcal-server: warning: the data was damaged before the backup (%s); "
                 "`rigcal-server check` names it\n",
                 FaultsText(*report).c_str());
  }
  return 0;
}

int CareCommands::Restore(const std::string& data_directory) const {
  if (IsOtherFile(file_)) {
    return Fail(absl::InvalidArgumentError(
        absl::StrCat(file_, " is no backup of a server; rigcal-server backup FILE makes one")));
  }
  RestoredIdentity identity;
  const auto reconcile = [&](const fs::path& before, const fs::path& restored) -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(
        identity, TakeOverRevocations(IdentityDirectory(before), IdentityDirectory(restored)));
    return absl::OkStatus();
  };
  const auto report = RestoreDatabase(file_, data_directory,
                                      {.take_damaged = take_damaged_, .reconcile = reconcile},
                                      ProgressOf("restore"));
  if (!report.ok()) return Fail(report.status());
  std::printf("%s: restored %s\n", data_directory.c_str(), CountsText(report->backup).c_str());
  if (!report->kept.empty()) {
    std::printf("the data before is in %s; remove it when you do not need it\n",
                report->kept.c_str());
  }
  std::error_code error;
  if (fs::exists(IdentityDirectory(data_directory) / "ca.key", error)) PrintIdentity(identity);
  return 0;
}

int CareCommands::Compact(const std::string& data_directory) const {
  std::error_code error;
  const fs::path file = fs::path(data_directory) / "rigcal.db";
  if (!fs::exists(file, error)) {
    return Fail(absl::NotFoundError(absl::StrCat("there is no database in ", data_directory)));
  }
  const uint64_t before = SizeWithLog(file);
  const CareProgress progress = ProgressOf("compact");
  const absl::Status status = CompactHereOrThere(data_directory, server_, progress);
  if (!status.ok()) return Fail(status);
  const uint64_t now = SizeWithLog(file);
  if (now < before) {
    std::printf("%s: freed %s, %s before, %s now\n", file.c_str(), Megabytes(before - now).c_str(),
                Megabytes(before).c_str(), Megabytes(now).c_str());
  } else {
    std::printf("%s: there was nothing to free, %s\n", file.c_str(), Megabytes(now).c_str());
  }
  return 0;
}

}  // namespace rigcal::server
