// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "server/store/postgresql/postgres_connection.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {

// The statements of the store's tables on whatever connection there is at the moment: statements
// outlive connections, and are prepared again on a new one.
class PostgresDatabase final : public SqlDatabase {
 public:
  explicit PostgresDatabase(const PostgresAddress& address) : address_(address) {}

  // UNAVAILABLE and others as PostgresConnection::Open.
  absl::Status Connect();
  void Disconnect() { connection_.reset(); }
  bool connected() const { return connection_ != nullptr && connection_->alive(); }
  // Throws PostgresError where there is none.
  PostgresConnection& connection() const;
  const PostgresAddress& address() const { return address_; }

  std::unique_ptr<SqlStatementDriver> Prepare(const std::string& sql) override;
  std::string NowMs() const override;
  std::string SkipLocked() const override { return " FOR UPDATE SKIP LOCKED"; }
  absl::Status StatusOf(const std::exception& error, std::string_view what) const override;

 private:
  const PostgresAddress address_;
  std::unique_ptr<PostgresConnection> connection_;
};

}  // namespace rigcal::server
