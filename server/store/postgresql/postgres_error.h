// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

#include "absl/status/status.h"

namespace rigcal::server {

inline constexpr char kPoolerAdvice[] =
    "a pooler between gives each transaction another session; connect to PostgreSQL itself, or set "
    "pool_mode = session for this database (rigcal-server needs three connections)";

// A statement that failed. `sqlstate` is PostgreSQL's code (appendix "Error Codes" of its manual),
// or one of these two.
class PostgresError : public std::runtime_error {
 public:
  static constexpr char kConnectionLost[] = "08006";
  // A row that must be there is not: another server has taken the database over.
  static constexpr char kTakenOver[] = "RG001";

  PostgresError(std::string sqlstate, const std::string& message)
      : std::runtime_error(message), sqlstate_(std::move(sqlstate)) {}

  const std::string& sqlstate() const { return sqlstate_; }
  // Nothing more can be done with the connection.
  bool connection_lost() const;
  // The same transaction may succeed when it is run again.
  bool repeatable() const { return sqlstate_ == "40001" || sqlstate_ == "40P01"; }

 private:
  std::string sqlstate_;
};

// The status for an error; `what` begins the message ("storing observations"), `place` names host
// and database.
//   UNAVAILABLE          the connection is lost, the server ends or is not ready, too many clients
//   RESOURCE_EXHAUSTED   its disk is full
//   DATA_LOSS            a page or an index is damaged
//   FAILED_PRECONDITION  no right to do it; another server has taken the database over
//   INTERNAL             anything else
absl::Status StatusFromPostgres(const PostgresError& error, std::string_view what,
                                std::string_view place);

}  // namespace rigcal::server
