// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/sqlite_store.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "common/file/private_folder.h"
#include "common/status/status_macros.h"
#include "server/store/data_directory.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_schema.h"

namespace rigcal::server {
namespace {

// One step of compacting: a few milliseconds.
constexpr int kCompactPages = 512;
constexpr int64_t kIncrementalVacuum = 2;

std::string Mebibytes(uint64_t bytes) { return absl::StrCat(bytes >> 20, " MiB"); }

uint64_t FileSize(const std::filesystem::path& path) {
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(path, error);
  return error ? 0 : size;
}

}  // namespace

absl::StatusOr<std::unique_ptr<SqliteStore>> SqliteStore::Open(const SqliteStoreOptions& options) {
  if (options.data_directory.empty()) {
    return absl::InvalidArgumentError("data_directory is empty");
  }
  std::unique_ptr<SqliteStore> store(new SqliteStore(options));
  RIGCAL_ASSIGN_OR_RETURN(store->directory_, DataDirectory::Open(options.data_directory));
  // SQLite gives its other files the mode of the database, and would follow a link. Closed again
  // before SQLite opens it: no lock of its gets lost.
  RIGCAL_RETURN_IF_ERROR(OpenPrivateFile(store->directory_->database_file()).status());
  absl::Status opened = store->OpenDatabase();
  if (absl::IsResourceExhausted(opened)) {
    // A database of an earlier release is brought up to date, which takes room.
    store->directory_->ReleaseReserve();
    opened = store->OpenDatabase();
  }
  RIGCAL_RETURN_IF_ERROR(opened);
  store->directory_->FillReserve(options.reserve_bytes);
  return store;
}

SqliteStore::SqliteStore(const SqliteStoreOptions& options) : options_(options) {}

SqliteStore::~SqliteStore() { ForgetStatements(); }

absl::Status SqliteStore::OpenDatabase() {
  // What an attempt before has left, statements before their connection.
  count_unused_pages_.reset();
  ForgetStatements();
  reader_.reset();
  writer_.reset();
  const std::filesystem::path file = directory_->database_file();
  RIGCAL_ASSIGN_OR_RETURN(writer_,
                          SqliteWriter::Open(file, options_.vfs, options_.checkpoint_bytes));
  absl::Status prepared =
      writer_->Transact("preparing the database", [&](SqlDatabase&) -> absl::Status {
        RIGCAL_RETURN_IF_ERROR(PrepareSchema(writer_->database(), file.string()));
        RIGCAL_ASSIGN_OR_RETURN(server_id_, ReadServerId(writer_->database()));
        return absl::OkStatus();
      });
  if (!prepared.ok()) return prepared;
  try {
    count_unused_pages_ = std::make_unique<SQLite::Statement>(
        writer_->database(),
        "SELECT freelist_count, page_size FROM pragma_freelist_count, pragma_page_size");
    NoteSize();
    RIGCAL_ASSIGN_OR_RETURN(reader_, SqliteReader::Open(file, options_.vfs));
    Use(writer_.get(), reader_.get());
  } catch (const SQLite::Exception& error) {
    return StatusFromSqlite(error, "preparing statements");
  }
  return absl::OkStatus();
}

StoreHealth SqliteStore::Health() const {
  StoreHealth health{.kind = "sqlite", .schema_version = kSchemaVersion};
  const std::filesystem::path file = directory_->database_file();
  health.size_bytes = FileSize(file) + FileSize(file.string() + "-wal");
  health.free_bytes = directory_->FreeBytes().value_or(0);
  health.reserve_bytes = options_.min_free_bytes;
  health.problem = std::string(writer_->problem().message());
  health.read_problem = reader_->problem();
  health.unused_bytes = unused_bytes_;
  return health;
}

void SqliteStore::NoteSize() {
  const absl::Cleanup reset = [this] { count_unused_pages_->tryReset(); };
  count_unused_pages_->executeStep();
  unused_bytes_ = static_cast<uint64_t>(count_unused_pages_->getColumn(0).getInt64() *
                                        count_unused_pages_->getColumn(1).getInt64());
}

absl::StatusOr<int64_t> SqliteStore::ReadNumber(const char* pragma) const {
  return reader_->Read("reading the size of the database",
                       [&](SqlDatabase& database) -> absl::StatusOr<int64_t> {
                         SqlStatement row(database, absl::StrCat("PRAGMA ", pragma));
                         row.Step();
                         return row.Int64(0);
                       });
}

absl::Status SqliteStore::CheckRoom() const {
  const std::optional<uint64_t> free_bytes = directory_->FreeBytes();
  // Deleting gives no space back to the disk, but into the database, where it is used again.
  if (!free_bytes || *free_bytes + unused_bytes_ >= options_.min_free_bytes) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(absl::StrCat(
      "no observations are stored: the disk of ", directory_->path().string(), " has ",
      Mebibytes(*free_bytes), " left, and ", Mebibytes(options_.min_free_bytes),
      " are its reserve; free space, delete sessions, or lower ", "limits.disk_reserve_mb"));
}

absl::Status SqliteStore::Erase(const std::function<absl::Status()>& erase) {
  absl::Status status = erase();
  if (absl::IsResourceExhausted(status)) {
    // Deleting writes to the log first. The reserve makes room for that, and the checkpoint empties
    // the log.
    directory_->ReleaseReserve();
    RIGCAL_RETURN_IF_ERROR(writer_->Checkpoint());
    status = erase();
    if (!status.ok()) return status;
    RIGCAL_RETURN_IF_ERROR(writer_->Checkpoint());
  }
  directory_->FillReserve(options_.reserve_bytes);
  return status;
}

absl::StatusOr<std::vector<AppendOutcome>> SqliteStore::Append(
    absl::Span<const Delivery> deliveries) {
  // What has no rows is small: the beginnings and ends of streams are noted as long as they fit.
  if (std::ranges::any_of(deliveries, [](const Delivery& one) { return one.batch.rows() > 0; })) {
    RIGCAL_RETURN_IF_ERROR(CheckRoom());
  }
  auto outcomes = SqlStore::Append(deliveries);
  if (absl::IsResourceExhausted(outcomes.status()) && unused_bytes_ > 0) {
    // The log is full, and not the database: emptied, it has room for the next.
    RIGCAL_RETURN_IF_ERROR(writer_->CheckpointWithoutWaiting());
    outcomes = SqlStore::Append(deliveries);
  }
  return outcomes;
}

absl::Status SqliteStore::Compact(const std::function<absl::Status(double)>& progress) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t mode, ReadNumber("auto_vacuum"));
  RIGCAL_RETURN_IF_ERROR(progress(0));
  if (mode != kIncrementalVacuum) RIGCAL_RETURN_IF_ERROR(Rewrite());
  RIGCAL_ASSIGN_OR_RETURN(const int64_t unused, ReadNumber("freelist_count"));
  int64_t left = unused;
  while (left > 0) {
    RIGCAL_RETURN_IF_ERROR(writer_->Transact("compacting", [&](SqlDatabase&) {
      writer_->database().exec(absl::StrCat("PRAGMA incremental_vacuum(", kCompactPages, ")"));
      NoteSize();
      return absl::OkStatus();
    }));
    const int64_t before = left;
    RIGCAL_ASSIGN_OR_RETURN(left, ReadNumber("freelist_count"));
    if (left >= before) break;  // others delete at the same time
    RIGCAL_RETURN_IF_ERROR(
        progress(static_cast<double>(unused - left) / static_cast<double>(unused)));
  }
  RIGCAL_RETURN_IF_ERROR(writer_->CheckpointWithoutWaiting());
  return progress(1);
}

absl::Status SqliteStore::Rewrite() {
  const StoreHealth health = Health();
  // The copy, and the log that it is written back through.
  const uint64_t needed = 2 * health.size_bytes + options_.min_free_bytes;
  if (health.free_bytes < needed) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "this database was made by an earlier release, and compacting it for the first time needs ",
        Mebibytes(needed), " on the disk of ", directory_->path().string(), "; it has ",
        Mebibytes(health.free_bytes), " left: free space, or delete sessions"));
  }
  return writer_->RunAlone("compacting", [&] {
    writer_->database().exec("PRAGMA temp_store=FILE");
    writer_->database().exec("PRAGMA auto_vacuum=INCREMENTAL");
    writer_->database().exec("VACUUM");
    writer_->database().exec("PRAGMA temp_store=MEMORY");
  });
}

}  // namespace rigcal::server
