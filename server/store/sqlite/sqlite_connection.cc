// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/sqlite_connection.h"

#include <spdlog/spdlog.h>
#include <sqlite3.h>

#include <exception>
#include <limits>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr int kWriterCacheKiB = 16 << 10;
constexpr int kBusyTimeoutMs = 10000;
constexpr size_t kPageBytes = 4096;

int RememberLogPages(void* log_pages, sqlite3*, const char*, int pages) {
  *static_cast<int*>(log_pages) = pages;
  return SQLITE_OK;
}

void ConfigureConnection(SQLite::Database& database) {
  DistrustSchema(database);
  database.setBusyTimeout(kBusyTimeoutMs);
  database.exec(
      "PRAGMA mmap_size=0;"
      "PRAGMA cell_size_check=ON;"
      "PRAGMA temp_store=MEMORY;"
      "PRAGMA foreign_keys=ON;");
}

int PrimaryCode(const SQLite::Exception& error) { return error.getErrorCode() & 0xff; }

// Growing the shared index of the write-ahead log fails with an I/O code when the disk is full.
bool IsDiskFull(const SQLite::Exception& error) {
  return PrimaryCode(error) == SQLITE_FULL || error.getExtendedErrorCode() == SQLITE_IOERR_SHMSIZE;
}

// The disk failed to read, write or sync: what the database holds in memory and what is on the disk
// may differ from now on.
bool IsDiskFailure(const SQLite::Exception& error) {
  return PrimaryCode(error) == SQLITE_IOERR && !IsDiskFull(error);
}

class SqliteStatement final : public SqlStatementDriver {
 public:
  SqliteStatement(SQLite::Database& database, const std::string& sql) : statement_(database, sql) {}

  void BindNumber(int index, int64_t value) override { statement_.bind(index, value); }
  void BindText(int index, std::string_view text) override {
    statement_.bind(index, std::string(text));
  }
  void BindBlob(int index, std::string_view bytes) override {
    if (bytes.size() > static_cast<size_t>(std::numeric_limits<int>::max())) {
      throw SQLite::Exception("a blob is larger than 2 GB", SQLITE_TOOBIG);
    }
    // A null pointer would bind NULL instead of an empty blob.
    const char* data = bytes.empty() ? "" : bytes.data();
    statement_.bindNoCopy(index, static_cast<const void*>(data), static_cast<int>(bytes.size()));
  }
  void BindNull(int index) override { statement_.bind(index); }
  void Run() override { statement_.exec(); }
  int64_t RunAndCount() override { return statement_.exec(); }
  bool Step() override { return statement_.executeStep(); }
  void Reset() override { statement_.tryReset(); }
  bool IsNull(int column) override { return statement_.getColumn(column).isNull(); }
  int64_t Number(int column) override { return statement_.getColumn(column).getInt64(); }
  std::string_view Bytes(int column) override {
    const SQLite::Column value = statement_.getColumn(column);
    const void* data = value.getBlob();
    return {static_cast<const char*>(data), static_cast<size_t>(value.getBytes())};
  }

 private:
  SQLite::Statement statement_;
};

}  // namespace

void DistrustSchema(SQLite::Database& database) {
  // We have neither triggers nor views; foreign keys work without.
  for (const auto& [option, on] : {std::pair{SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0},
                                   {SQLITE_DBCONFIG_ENABLE_TRIGGER, 0},
                                   {SQLITE_DBCONFIG_ENABLE_VIEW, 0},
                                   {SQLITE_DBCONFIG_DEFENSIVE, 1}}) {
    sqlite3_db_config(database.getHandle(), option, on, nullptr);
  }
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

std::unique_ptr<SqlStatementDriver> SqliteDatabase::Prepare(const std::string& sql) {
  return std::make_unique<SqliteStatement>(database_, sql);
}

std::string SqliteDatabase::NowMs() const {
  // Days since noon of 4713 BC ("Date And Time Functions" in SQLite's manual); 1970 is day
  // 2440587.5. Kept to 0.05 ms in a double.
  return "CAST(round((julianday('now')-2440587.5)*86400000.0) AS INTEGER)";
}

absl::Status SqliteDatabase::StatusOf(const std::exception& error, std::string_view what) const {
  if (const auto* of_sqlite = dynamic_cast<const SQLite::Exception*>(&error)) {
    return StatusFromSqlite(*of_sqlite, what);
  }
  return absl::InternalError(absl::StrCat(std::string(what), ": ", error.what()));
}

absl::StatusOr<std::unique_ptr<SqliteWriter>> SqliteWriter::Open(const std::filesystem::path& file,
                                                                 const std::string& vfs,
                                                                 size_t checkpoint_bytes) {
  std::unique_ptr<SqliteWriter> writer(new SqliteWriter());
  writer->checkpoint_pages_ = static_cast<int>(
      std::min<size_t>(checkpoint_bytes / kPageBytes, std::numeric_limits<int>::max()));
  try {
    writer->database_ = std::make_unique<SQLite::Database>(
        file.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_NOMUTEX,
        kBusyTimeoutMs, vfs);
    SQLite::Database& database = *writer->database_;
    ConfigureConnection(database);
    // Overwriting deleted data (Debian's default) would make deleting a session cost as much as
    // writing it.
    database.exec("PRAGMA secure_delete=OFF");
    if (database.execAndGet("PRAGMA page_count").getInt() == 0) {
      // So that space can be given back in small steps.
      database.exec("PRAGMA auto_vacuum=INCREMENTAL");
    }
    const std::string mode = database.execAndGet("PRAGMA journal_mode=WAL").getString();
    if (mode != "wal") {
      return absl::FailedPreconditionError(
          absl::StrCat("opening ", file.string(),
                       ": its file system cannot do write-ahead logging (journal mode is ", mode,
                       "); use a data directory on a local disk"));
    }
    database.exec("PRAGMA synchronous=FULL");
    // A commit of hundreds of streams changes a page of each, and more: with SQLite's 2 MB they
    // would be written and read again within the transaction.
    database.exec(absl::StrCat("PRAGMA cache_size=-", kWriterCacheKiB));
    database.exec("PRAGMA journal_size_limit=67108864");
    // Checkpoints are ours: the automatic ones swallow errors of the disk.
    sqlite3_wal_hook(database.getHandle(), &RememberLogPages, &writer->log_pages_);
    writer->sql_ = std::make_unique<SqliteDatabase>(database);
    writer->begin_ = std::make_unique<SQLite::Statement>(database, "BEGIN IMMEDIATE");
    writer->commit_ = std::make_unique<SQLite::Statement>(database, "COMMIT");
  } catch (const SQLite::Exception& error) {
    return StatusFromSqlite(error, absl::StrCat("opening ", file.string()));
  }
  return writer;
}

SqliteWriter::~SqliteWriter() {
  if (!broken_.ok()) {
    // Closing moves the log into the database, which is a write, and those have ended.
    sqlite3_db_config(database_->getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  }
}

absl::Status SqliteWriter::Transact(std::string_view what, const Work& work,
                                    const std::function<void()>& on_rollback) {
  const std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(problem());
  absl::Status status = TransactLocked(what, work);
  if (status.ok()) {
    // Not an error for the caller: the transaction is durable. With a full disk or a busy reader
    // the log grows, and the next transaction tries again.
    if (log_pages_ >= checkpoint_pages_) CheckpointLocked(SQLITE_CHECKPOINT_PASSIVE).IgnoreError();
  } else if (on_rollback) {
    on_rollback();
  }
  return status;
}

absl::Status SqliteWriter::TransactLocked(std::string_view what, const Work& work) {
  try {
    begin_->exec();
    begin_->reset();
    absl::Status status = work(*sql_);
    if (status.ok()) {
      const absl::Cleanup reset = [this] { commit_->tryReset(); };
      commit_->exec();
    } else {
      RollBack();
    }
    return status;
  } catch (const SQLite::Exception& error) {
    RollBack();
    return NoteFailure(error, what);
  } catch (const std::exception& error) {
    RollBack();
    return absl::InternalError(absl::StrCat(std::string(what), ": ", error.what()));
  }
}

void SqliteWriter::RollBack() {
  begin_->tryReset();
  // Some errors have rolled back already.
  if (sqlite3_get_autocommit(database_->getHandle()) != 0) return;
  database_->tryExec("ROLLBACK");
}

absl::Status SqliteWriter::Checkpoint() {
  const std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(problem());
  return CheckpointLocked(SQLITE_CHECKPOINT_TRUNCATE);
}

absl::Status SqliteWriter::CheckpointWithoutWaiting() {
  const std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(problem());
  database_->setBusyTimeout(0);
  const absl::Status status = CheckpointLocked(SQLITE_CHECKPOINT_TRUNCATE);
  database_->setBusyTimeout(kBusyTimeoutMs);
  // A reader uses the log: it is emptied another time.
  return absl::IsUnavailable(status) ? absl::OkStatus() : status;
}

absl::Status SqliteWriter::problem() const {
  const std::lock_guard lock(broken_mutex_);
  return broken_;
}

absl::Status SqliteWriter::RunAlone(std::string_view what, const std::function<void()>& work) {
  const std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(problem());
  try {
    work();
    return absl::OkStatus();
  } catch (const SQLite::Exception& error) {
    return NoteFailure(error, what);
  }
}

absl::Status SqliteWriter::CheckpointLocked(int mode) {
  const int result =
      sqlite3_wal_checkpoint_v2(database_->getHandle(), nullptr, mode, nullptr, nullptr);
  if (result == SQLITE_OK) return absl::OkStatus();
  const SQLite::Exception error(database_->getHandle(), result);
  return NoteFailure(error, "moving the log into the database");
}

absl::Status SqliteWriter::NoteFailure(const SQLite::Exception& error, std::string_view what) {
  const absl::Status status = StatusFromSqlite(error, what);
  if (!IsDiskFailure(error)) return status;
  const std::lock_guard lock(broken_mutex_);
  broken_ = absl::InternalError(
      absl::StrCat(std::string(status.message()),
                   "; nothing is stored any more: check the disk, then restart the server"));
  return broken_;
}

std::string SqliteReader::problem() const {
  const std::lock_guard lock(problem_mutex_);
  return problem_;
}

absl::Status SqliteReader::NoteFailure(const SQLite::Exception& error, std::string_view what) {
  absl::Status status = StatusFromSqlite(error, what);
  if (!IsDiskFailure(error) && !absl::IsDataLoss(status)) return status;
  const std::lock_guard lock(problem_mutex_);
  if (problem_.empty()) {
    problem_ = absl::StrCat("the store cannot be read: ", std::string(status.message()),
                            "; check the disk, and run `rigcal-server check`");
    spdlog::error("{}", problem_);
  }
  return status;
}

absl::Status SqliteReader::ReadWith(std::string_view what, const SqlWriter::Work& work) {
  const std::lock_guard lock(mutex_);
  try {
    SQLite::Transaction transaction(*database_);
    absl::Status status = work(*sql_);
    transaction.commit();
    return status;
  } catch (const SQLite::Exception& error) {
    return NoteFailure(error, what);
  }
}

absl::StatusOr<std::unique_ptr<SqliteReader>> SqliteReader::Open(const std::filesystem::path& file,
                                                                 const std::string& vfs) {
  std::unique_ptr<SqliteReader> reader(new SqliteReader());
  try {
    reader->database_ = std::make_unique<SQLite::Database>(
        file.string(), SQLite::OPEN_READONLY | SQLite::OPEN_NOMUTEX, kBusyTimeoutMs, vfs);
    ConfigureConnection(*reader->database_);
    reader->sql_ = std::make_unique<SqliteDatabase>(*reader->database_);
  } catch (const SQLite::Exception& error) {
    return StatusFromSqlite(error, absl::StrCat("opening ", file.string(), " for reading"));
  }
  return reader;
}

}  // namespace rigcal::server
