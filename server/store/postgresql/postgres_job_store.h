// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "server/store/postgresql/postgres_job_writer.h"
#include "server/store/postgresql/postgres_reader.h"
#include "server/store/sql/sql_store.h"

namespace rigcal::server {

// The database of a rigcal-server, opened beside it by a rigcal-worker: it reads everything, and
// writes through Store's functions of jobs alone.
class PostgresJobStore final : public SqlStore {
 public:
  // INVALID_ARGUMENT: the address cannot be read. FAILED_PRECONDITION: a pooler gives each
  // transaction another session. Else as PostgresJobWriter::Open.
  static absl::StatusOr<std::unique_ptr<PostgresJobStore>> Open(const std::string& url);
  ~PostgresJobStore() override { ForgetStatements(); }

  std::string server_id() const override { return writer_->server_id(); }
  bool jobs_are_shared() const override { return true; }
  StoreHealth Health() const override;
  // UNIMPLEMENTED.
  absl::Status Compact(const std::function<absl::Status(double)>& progress) override;

 private:
  PostgresJobStore() = default;

  std::unique_ptr<PostgresJobWriter> writer_;
  std::unique_ptr<PostgresReader> reader_;
};

}  // namespace rigcal::server
