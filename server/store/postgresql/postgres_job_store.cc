// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_job_store.h"

#include "common/status/status_macros.h"
#include "server/store/postgresql/postgres_schema.h"
#include "server/store/postgresql/postgres_start_check.h"

namespace rigcal::server {

absl::StatusOr<std::unique_ptr<PostgresJobStore>> PostgresJobStore::Open(const std::string& url) {
  RIGCAL_ASSIGN_OR_RETURN(const PostgresAddress address, PostgresAddress::Parse(url));
  std::unique_ptr<PostgresJobStore> store(new PostgresJobStore());
  RIGCAL_ASSIGN_OR_RETURN(store->writer_, PostgresJobWriter::Open(address));
  RIGCAL_ASSIGN_OR_RETURN(store->reader_, PostgresReader::Open(address));
  try {
    RIGCAL_RETURN_IF_ERROR(
        CheckNoTransactionPooler(store->writer_->connection(), store->reader_->connection()));
  } catch (const PostgresError& error) {
    return StatusFromPostgres(error, "looking for a pooler", address.text());
  }
  store->Use(store->writer_.get(), store->reader_.get());
  return store;
}

StoreHealth PostgresJobStore::Health() const {
  return {.kind = "postgresql",
          .schema_version = kPostgresSchemaVersion,
          .counts_unused = false,
          .problem = writer_->problem(),
          .read_problem = reader_->problem()};
}

absl::Status PostgresJobStore::Compact(const std::function<absl::Status(double)>&) {
  return absl::UnimplementedError("a rigcal-worker does not care for the database");
}

}  // namespace rigcal::server
