// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// What the tables of a store need of a database, so that one code serves every kind. The statements
// are written in what SQLite and PostgreSQL have in common: parameters are `?` or `?1`, numbers are
// of 64 bits, conditions on numbers are comparisons (`late<>0`), sums are cast to BIGINT.
//
// A database throws exceptions of its own kind (std::exception); who runs a transaction turns them
// into a status.
namespace rigcal::server {

// A prepared statement of a database. Columns count from 0, parameters from 1. Bytes of a column
// are good until the next Step or Reset.
class SqlStatementDriver {
 public:
  virtual ~SqlStatementDriver() = default;
  virtual void BindNumber(int index, int64_t value) = 0;
  virtual void BindText(int index, std::string_view text) = 0;
  // Not copied: the bytes must outlive the run.
  virtual void BindBlob(int index, std::string_view bytes) = 0;
  virtual void BindNull(int index) = 0;
  // May be sent later: its error comes with a later statement, or with the commit.
  virtual void Run() = 0;
  // The number of rows that it has changed.
  virtual int64_t RunAndCount() = 0;
  // To the next row; false: there is none.
  virtual bool Step() = 0;
  virtual void Reset() = 0;
  virtual bool IsNull(int column) = 0;
  virtual int64_t Number(int column) = 0;  // 0 for NULL
  virtual std::string_view Bytes(int column) = 0;
};

class SqlDatabase {
 public:
  virtual ~SqlDatabase() = default;
  // Must outlive the statement.
  virtual std::unique_ptr<SqlStatementDriver> Prepare(const std::string& sql) = 0;
  // Expressions: the database's clock, milliseconds since 1970, and what ends a SELECT that takes
  // rows which no other transaction holds, for as long as this one lasts.
  virtual std::string NowMs() const = 0;
  virtual std::string SkipLocked() const = 0;
  // The status for an exception of this kind of database; `what` begins the message.
  virtual absl::Status StatusOf(const std::exception& error, std::string_view what) const = 0;
};

// A value of a statement that is not copied: the bytes must outlive the statement's next reset.
struct Blob {
  std::string_view bytes;
};

class SqlStatement {
 public:
  SqlStatement(SqlDatabase& database, const std::string& sql) : driver_(database.Prepare(sql)) {}

  bool Step() { return driver_->Step(); }
  void Run() { driver_->Run(); }
  int64_t RunAndCount() { return driver_->RunAndCount(); }
  void Reset() { driver_->Reset(); }

  bool IsNull(int column) { return driver_->IsNull(column); }
  int64_t Int64(int column) { return driver_->Number(column); }
  // Values outside the range of the type become its nearest one.
  uint32_t Uint32(int column);
  uint64_t Uint64(int column);
  std::string_view Bytes(int column) { return driver_->Bytes(column); }
  std::string Text(int column) { return std::string(driver_->Bytes(column)); }

  void Bind(int index, std::string_view text) { driver_->BindText(index, text); }
  void Bind(int index, Blob blob) { driver_->BindBlob(index, blob.bytes); }
  void Bind(int index, std::optional<uint32_t> number);
  // Numbers beyond the largest of 63 bits become that one; enums are bound as their numbers.
  template <typename Number>
  requires std::is_integral_v<Number> || std::is_enum_v<Number>
  void Bind(int index, Number value) {
    if constexpr (std::is_same_v<Number, uint64_t>) {
      driver_->BindNumber(index, static_cast<int64_t>(std::min<uint64_t>(value, INT64_MAX)));
    } else {
      driver_->BindNumber(index, static_cast<int64_t>(value));
    }
  }

 private:
  std::unique_ptr<SqlStatementDriver> driver_;
};

// Resets a kept statement at the end of the scope, so that it holds no locks and no pointers.
class StatementScope {
 public:
  explicit StatementScope(SqlStatement& statement) : statement_(statement) {}
  ~StatementScope() { statement_.Reset(); }
  StatementScope(const StatementScope&) = delete;
  StatementScope& operator=(const StatementScope&) = delete;

 private:
  SqlStatement& statement_;
};

// Binds `values` to the statement's parameters 1, 2, ...
template <typename... Values>
void BindAll(SqlStatement& statement, const Values&... values) {
  int index = 0;
  (statement.Bind(++index, values), ...);
}

// Runs a kept statement with these values; it may be sent later.
template <typename... Values>
void Execute(SqlStatement& statement, const Values&... values) {
  const StatementScope scope(statement);
  BindAll(statement, values...);
  statement.Run();
}

// The same at once; returns the number of rows it changed.
template <typename... Values>
int64_t ExecuteAndCount(SqlStatement& statement, const Values&... values) {
  const StatementScope scope(statement);
  BindAll(statement, values...);
  return statement.RunAndCount();
}

// A statement with these values, ready to step.
template <typename... Values>
SqlStatement Query(SqlDatabase& database, const std::string& sql, const Values&... values) {
  SqlStatement statement(database, sql);
  BindAll(statement, values...);
  return statement;
}

// Makes the transactions that write, one at a time. Thread-safe.
class SqlWriter {
 public:
  using Work = std::function<absl::Status(SqlDatabase& database)>;
  virtual ~SqlWriter() = default;
  // Runs `work` in a transaction that is durable when OK is returned, and rolled back otherwise.
  // `on_rollback` is called before another transaction can begin. What `work` throws becomes a
  // status that begins with `what`.
  virtual absl::Status Transact(std::string_view what, const Work& work,
                                const std::function<void()>& on_rollback = nullptr) = 0;
  // For preparing statements; they are run inside `work` only.
  virtual SqlDatabase& sql() = 0;
};

// Reads. Thread-safe.
class SqlReader {
 public:
  virtual ~SqlReader() = default;
  // Runs `work` on one consistent state of the database; it may be run again after a failure of the
  // connection.
  virtual absl::Status ReadWith(std::string_view what, const SqlWriter::Work& work) = 0;

  // The same for work that returns a Status or a StatusOr.
  template <typename Work>
  std::invoke_result_t<Work, SqlDatabase&> Read(std::string_view what, const Work& work) {
    using Result = std::invoke_result_t<Work, SqlDatabase&>;
    if constexpr (std::is_same_v<Result, absl::Status>) {
      return ReadWith(what, work);
    } else {
      std::optional<Result> result;
      const absl::Status read = ReadWith(what, [&](SqlDatabase& database) {
        result.emplace(work(database));
        return result->status();
      });
      if (!read.ok()) return read;
      return *std::move(result);
    }
  }
};

}  // namespace rigcal::server
