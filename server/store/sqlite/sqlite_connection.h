// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {

// The status for an error of SQLite; `what` begins the message: "storing observations".
//   RESOURCE_EXHAUSTED  the disk is full
//   DATA_LOSS           the database is damaged, or the file is no database
//   UNAVAILABLE         locked by another program
//   INTERNAL            anything else, errors of the disk among them
absl::Status StatusFromSqlite(const SQLite::Exception& error, std::string_view what);

// For a database that may come from anywhere: nothing in its schema runs (triggers, views,
// functions in expressions), and no statement can damage the file. Before anything else is done
// with it.
void DistrustSchema(SQLite::Database& database);

// Statements of a connection for the tables of the store. The connection must outlive it.
class SqliteDatabase final : public SqlDatabase {
 public:
  explicit SqliteDatabase(SQLite::Database& database) : database_(database) {}
  std::unique_ptr<SqlStatementDriver> Prepare(const std::string& sql) override;
  std::string NowMs() const override;
  // Nothing: there is one that writes.
  std::string SkipLocked() const override { return ""; }
  absl::Status StatusOf(const std::exception& error, std::string_view what) const override;

 private:
  SQLite::Database& database_;
};

// The one connection that writes and checkpoints. Thread-safe. `work` given to the functions below
// may throw SQLite::Exception, which becomes a status that begins with `what`.
class SqliteWriter final : public SqlWriter {
 public:
  // Opens or creates `file` with WAL and synchronous=FULL. `vfs`: empty for the system's own. The
  // log is moved into the database whenever it has grown to `checkpoint_bytes`.
  static absl::StatusOr<std::unique_ptr<SqliteWriter>> Open(const std::filesystem::path& file,
                                                            const std::string& vfs,
                                                            size_t checkpoint_bytes);
  ~SqliteWriter() override;
  SqliteWriter(const SqliteWriter&) = delete;
  SqliteWriter& operator=(const SqliteWriter&) = delete;

  // After a disk failure every later call fails with INTERNAL: a failed sync must not be tried
  // again, as the kernel may have dropped the pages that it could not write.
  absl::Status Transact(std::string_view what, const Work& work,
                        const std::function<void()>& on_rollback = nullptr) override;
  SqlDatabase& sql() override { return *sql_; }
  // Runs `work` without a transaction around it, for statements that bring their own.
  absl::Status RunAlone(std::string_view what, const std::function<void()>& work);
  // Moves everything from the log into the database and empties the log. Waits for readers.
  absl::Status Checkpoint();
  // Moves what no reader needs, without waiting, and empties the log where no reader uses it.
  absl::Status CheckpointWithoutWaiting();
  // OK, or the disk failure after which nothing is written. Never waits for a transaction.
  absl::Status problem() const;
  // For preparing statements while opening; afterwards use it inside `work` only.
  SQLite::Database& database() { return *database_; }

 private:
  SqliteWriter() = default;
  absl::Status TransactLocked(std::string_view what, const Work& work);
  void RollBack();
  absl::Status CheckpointLocked(int mode);
  // The error as a status; a disk failure ends all writing.
  absl::Status NoteFailure(const SQLite::Exception& error, std::string_view what);

  std::mutex mutex_;
  std::unique_ptr<SQLite::Database> database_;
  std::unique_ptr<SqliteDatabase> sql_;
  std::unique_ptr<SQLite::Statement> begin_;
  std::unique_ptr<SQLite::Statement> commit_;
  int log_pages_ = 0;
  int checkpoint_pages_ = 0;
  mutable std::mutex broken_mutex_;  // taken after mutex_
  absl::Status broken_;              // not OK after a disk failure
};

// A second connection that only reads. Thread-safe.
class SqliteReader final : public SqlReader {
 public:
  static absl::StatusOr<std::unique_ptr<SqliteReader>> Open(const std::filesystem::path& file,
                                                            const std::string& vfs);

  // Keep it short: readers wait for each other, and the log cannot be emptied meanwhile.
  absl::Status ReadWith(std::string_view what, const SqlWriter::Work& work) override;
  // Why reading has failed before: the disk does not give back what is on it, or the file is
  // damaged. Stays until the store is opened again: another read may find its data in memory. Never
  // waits for a reader.
  std::string problem() const;

 private:
  SqliteReader() = default;
  absl::Status NoteFailure(const SQLite::Exception& error, std::string_view what);

  mutable std::mutex problem_mutex_;  // taken after mutex_
  std::string problem_;
  std::mutex mutex_;
  std::unique_ptr<SQLite::Database> database_;
  std::unique_ptr<SqliteDatabase> sql_;
};

}  // namespace rigcal::server
