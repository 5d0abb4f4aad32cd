// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

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

void BindText(SQLite::Statement& statement, int index, std::string_view text);
// Does not copy: `bytes` must outlive the statement's next reset or binding.
void BindBlob(SQLite::Statement& statement, int index, std::string_view bytes);
std::string_view ColumnBytes(SQLite::Statement& statement, int index);
// Values outside the range of the type become its nearest one.
uint32_t ColumnUint32(SQLite::Statement& statement, int index);
uint64_t ColumnUint64(SQLite::Statement& statement, int index);

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
  // Moves everything from the log into the database and empties the log.
  absl::Status Checkpoint();
  // For preparing statements while opening; afterwards use it inside `work` only.
  SQLite::Database& database() { return *database_; }

 private:
  SqliteWriter() = default;
  absl::Status TransactLocked(std::string_view what, const std::function<absl::Status()>& work);
  void RollBack();
  void CheckpointWhenDue();

  std::mutex mutex_;
  std::unique_ptr<SQLite::Database> database_;
  std::unique_ptr<SQLite::Statement> begin_;
  std::unique_ptr<SQLite::Statement> commit_;
  int log_pages_ = 0;
  int checkpoint_pages_ = 0;
  absl::Status broken_;  // not OK after a disk failure
};

// A second connection that only reads. Thread-safe.
class SqliteReader {
 public:
  static absl::StatusOr<std::unique_ptr<SqliteReader>> Open(const std::filesystem::path& file,
                                                            const std::string& vfs);

  // Runs `work` on one consistent state of the database. Keep it short: readers wait for each
  // other, and the log cannot be emptied meanwhile.
  absl::Status Read(std::string_view what,
                    const std::function<absl::Status(SQLite::Database&)>& work);

 private:
  SqliteReader() = default;

  std::mutex mutex_;
  std::unique_ptr<SQLite::Database> database_;
};

}  // namespace rigcal::server
