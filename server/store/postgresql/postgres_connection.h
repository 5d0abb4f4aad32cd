// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libpq-fe.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "server/store/postgresql/postgres_address.h"
#include "server/store/postgresql/postgres_error.h"

namespace rigcal::server {

// A value of a statement's parameter.
struct PostgresValue {
  enum class Kind : uint8_t { kNumber, kText, kBlob };
  Kind kind = Kind::kNumber;
  bool null = false;
  int64_t number = 0;
  std::string text = {};
  std::string_view blob = {};
};

// The rows of a result; values in binary.
class PostgresResult {
 public:
  PostgresResult() = default;
  explicit PostgresResult(PGresult* result) : result_(result) {}

  PGresult* get() const { return result_.get(); }
  int rows() const { return PQntuples(result_.get()); }
  bool IsNull(int row, int column) const { return PQgetisnull(result_.get(), row, column) != 0; }
  // Of a column of numbers or truth values. Throws PostgresError for another type.
  int64_t Number(int row, int column) const;
  std::string_view Bytes(int row, int column) const;
  int64_t changed_rows() const;

 private:
  struct Clear {
    void operator()(PGresult* result) const { PQclear(result); }
  };
  std::unique_ptr<PGresult, Clear> result_;
};

// One connection. Statements are sent in libpq's pipeline mode: those whose result nobody waits for
// cost no round trip. Every function may throw PostgresError. Not thread-safe.
class PostgresConnection {
 public:
  // Opens the connection and sets the session: a commit returns when it is on disk, text is UTF-8.
  //   UNAVAILABLE          nobody answers there, or it is not ready
  //   FAILED_PRECONDITION  it refuses this user, or there is no such database
  static absl::StatusOr<std::unique_ptr<PostgresConnection>> Open(const PostgresAddress& address);

  // Sends a statement; its error comes with a later Fetch or Flush. `required_rows`: how many rows
  // it must change, else PostgresError::kTakenOver; -1: any number.
  void Send(const std::string& sql, absl::Span<const PostgresValue> values, int required_rows = -1);
  // Sends a statement and waits for its result and for all before it.
  PostgresResult Fetch(const std::string& sql, absl::Span<const PostgresValue> values);
  // Waits for all that was sent.
  void Flush() { ReadResults(); }
  // Statements without parameters, several between semicolons. Values of the last one, as text.
  std::vector<std::vector<std::string>> Run(const std::string& sql);
  // Ends a transaction that has failed. Throws only when the connection is lost.
  void RollBack();
  // The connection can be used.
  bool alive() const { return PQstatus(connection_.get()) == CONNECTION_OK; }
  PGconn* handle() const { return connection_.get(); }
  // Of the host that it has reached.
  const std::string& place() const { return place_; }

 private:
  struct Finish {
    void operator()(PGconn* connection) const { PQfinish(connection); }
  };
  PostgresConnection(PGconn* connection, std::string place)
      : connection_(connection), place_(std::move(place)) {}
  // The name of the prepared statement; empty: it is not kept.
  std::string Prepare(const std::string& sql, absl::Span<const PostgresValue> values);
  // Of everything sent; the last one is returned.
  PostgresResult ReadResults();
  [[noreturn]] void ThrowLost() const;
  void Require(int accepted) const;

  std::unique_ptr<PGconn, Finish> connection_;
  std::string place_;
  std::unordered_map<std::string, std::string> prepared_;  // names by SQL
  uint64_t next_name_ = 0;
  std::deque<int> sent_;  // statements without a result yet, with the rows that each must change
};

// `?` and `?1` as PostgreSQL writes them: `$1`. Those within quotes stay.
std::string NumberedParameters(std::string_view sql);

// What PostgreSQL takes as text: zero bytes and what is no UTF-8 become U+FFFD.
std::string StorableText(std::string_view text);

}  // namespace rigcal::server
