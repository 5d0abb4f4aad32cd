// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

// Resets a kept statement at the end of the scope, so that it holds no locks and no pointers.
class StatementScope {
 public:
  explicit StatementScope(SQLite::Statement& statement) : statement_(statement) {}
  ~StatementScope() { statement_.tryReset(); }
  StatementScope(const StatementScope&) = delete;
  StatementScope& operator=(const StatementScope&) = delete;

 private:
  SQLite::Statement& statement_;
};

// A value of a statement that is not copied: the bytes must outlive the statement's next reset.
struct Blob {
  std::string_view bytes;
};

void BindValue(SQLite::Statement& statement, int index, std::string_view text);
void BindValue(SQLite::Statement& statement, int index, Blob blob);
void BindValue(SQLite::Statement& statement, int index, std::optional<uint32_t> number);
// Numbers beyond the largest of SQLite become that one; enums are bound as their numbers.
template <typename Number>
requires std::is_integral_v<Number> || std::is_enum_v<Number>
void BindValue(SQLite::Statement& statement, int index, Number value) {
  if constexpr (std::is_same_v<Number, uint64_t>) {
    statement.bind(index, static_cast<int64_t>(std::min<uint64_t>(value, INT64_MAX)));
  } else {
    statement.bind(index, static_cast<int64_t>(value));
  }
}

// Binds `values` to the statement's parameters 1, 2, ...
template <typename... Values>
void BindAll(SQLite::Statement& statement, const Values&... values) {
  int index = 0;
  (BindValue(statement, ++index, values), ...);
}

// Runs a kept statement with these values; returns the number of rows it changed.
template <typename... Values>
int Execute(SQLite::Statement& statement, const Values&... values) {
  const StatementScope scope(statement);
  BindAll(statement, values...);
  return statement.exec();
}

// A statement with these values, ready to step.
template <typename... Values>
SQLite::Statement Query(SQLite::Database& database, const std::string& sql,
                        const Values&... values) {
  SQLite::Statement statement(database, sql);
  BindAll(statement, values...);
  return statement;
}

std::string_view ColumnBytes(SQLite::Statement& statement, int index);
// Values outside the range of the type become its nearest one.
uint32_t ColumnUint32(SQLite::Statement& statement, int index);
uint64_t ColumnUint64(SQLite::Statement& statement, int index);

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

// The one connection that writes and checkpoints. Thread-safe. `work` given to the functions below
// may throw SQLite::Exception, which becomes a status that begins with `what`.
class SqliteWriter {
 public:
  // Opens or creates `file` with WAL and synchronous=FULL. `vfs`: empty for the system's own. The
  // log is moved into the database whenever it has grown to `checkpoint_bytes`.
  static absl::StatusOr<std::unique_ptr<SqliteWriter>> Open(const std::filesystem::path& file,
                                                            const std::string& vfs,
                                                            size_t checkpoint_bytes);
  ~SqliteWriter();
  SqliteWriter(const SqliteWriter&) = delete;
  SqliteWriter& operator=(const SqliteWriter&) = delete;

  // Runs `work` in a transaction that is durable when OK is returned, and rolled back otherwise.
  // After a disk failure every later call fails with INTERNAL: a failed sync must not be tried
  // again, as the kernel may have dropped the pages that it could not write. `on_rollback` is
  // called before another transaction can begin.
  absl::Status Transact(std::string_view what, const std::function<absl::Status()>& work,
                        const std::function<void()>& on_rollback = nullptr);
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
  absl::Status TransactLocked(std::string_view what, const std::function<absl::Status()>& work);
  void RollBack();
  absl::Status CheckpointLocked(int mode);
  // The error as a status; a disk failure ends all writing.
  absl::Status NoteFailure(const SQLite::Exception& error, std::string_view what);

  std::mutex mutex_;
  std::unique_ptr<SQLite::Database> database_;
  std::unique_ptr<SQLite::Statement> begin_;
  std::unique_ptr<SQLite::Statement> commit_;
  int log_pages_ = 0;
  int checkpoint_pages_ = 0;
  mutable std::mutex broken_mutex_;  // taken after mutex_
  absl::Status broken_;              // not OK after a disk failure
};

// A second connection that only reads. Thread-safe.
class SqliteReader {
 public:
  static absl::StatusOr<std::unique_ptr<SqliteReader>> Open(const std::filesystem::path& file,
                                                            const std::string& vfs);

  // Runs `work`, which returns a Status or a StatusOr, on one consistent state of the database.
  // Keep it short: readers wait for each other, and the log cannot be emptied meanwhile.
  template <typename Work>
  std::invoke_result_t<Work, SQLite::Database&> Read(std::string_view what, const Work& work) {
    const std::lock_guard lock(mutex_);
    try {
      SQLite::Transaction transaction(*database_);
      auto result = work(*database_);
      transaction.commit();
      return result;
    } catch (const SQLite::Exception& error) {
      return NoteFailure(error, what);
    }
  }
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
};

}  // namespace rigcal::server
