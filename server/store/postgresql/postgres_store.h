// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/store/postgresql/postgres_writer.h"
#include "server/store/sql/sql_store.h"
#include "server/store/sql/table_check.h"

namespace rigcal::server {

class PostgresReader;

struct PostgresStoreOptions {
  std::string url;  // see PostgresAddress::Parse
  PostgresWriterOptions writer;
};

// One PostgreSQL database of this server's own. While the database cannot be reached, every call
// answers UNAVAILABLE, and the connections are made again by themselves.
class PostgresStore final : public SqlStore {
 public:
  // INVALID_ARGUMENT: the address cannot be read. Else as PostgresWriter::Open, and
  // CheckNoTransactionPooler.
  static absl::StatusOr<std::unique_ptr<PostgresStore>> Open(const PostgresStoreOptions& options);
  ~PostgresStore() override;

  std::string server_id() const override;
  // Free space and reserve are 0: the disk of the database is not known.
  StoreHealth Health() const override;
  // UNIMPLEMENTED: PostgreSQL uses its space again by itself; the message says how to shrink it.
  absl::Status Compact(const std::function<absl::Status(double)>& progress) override;
  bool jobs_are_shared() const override { return true; }

 private:
  PostgresStore() = default;
  void NoteForeignNumbers(SqlDatabase& database) override;
  // Connects again and reads the size, until the store ends.
  void Attend();
  void ReadSize();

  std::unique_ptr<PostgresWriter> writer_;
  std::unique_ptr<PostgresReader> reader_;
  std::atomic<uint64_t> size_bytes_ = 0;
  std::mutex mutex_;
  std::condition_variable ended_;
  bool end_ = false;
  std::thread attendant_;
};

// CheckTables of the database at `url`, in one consistent state; a server may run on it. Errors as
// PostgresStore::Open.
absl::StatusOr<DatabaseReport> CheckPostgresDatabase(const std::string& url,
                                                     const CareProgress& progress);

}  // namespace rigcal::server
