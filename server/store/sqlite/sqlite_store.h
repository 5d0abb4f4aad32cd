// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/sql/sql_store.h"

namespace rigcal::server {

class DataDirectory;
class SqliteReader;
class SqliteWriter;

struct SqliteStoreOptions {
  std::filesystem::path data_directory;  // created where it is missing
  // Room kept on the disk so that sessions can be deleted when it is full.
  size_t reserve_bytes = 8u << 20;
  // Observations are refused while the disk has less room than this.
  uint64_t min_free_bytes = uint64_t{256} << 20;
  // Size of the log at which it is moved into the database. Pages that are written again and again
  // (positions, counts) are moved once each time, so a large one costs less.
  size_t checkpoint_bytes = 16u << 20;
  // Name of a registered SQLite VFS; empty: the system's own. For tests of failing disks.
  std::string vfs = {};
};

// The embedded default: one SQLite database in the data directory, in write-ahead mode with
// synchronous=FULL. One connection writes, another reads.
class SqliteStore : public SqlStore {
 public:
  //   INVALID_ARGUMENT     no directory is named
  //   FAILED_PRECONDITION  another server uses the directory; the database is of a newer version or
  //                        of another program; the directory cannot be written
  //   DATA_LOSS            the database is damaged
  static absl::StatusOr<std::unique_ptr<SqliteStore>> Open(const SqliteStoreOptions& options);
  ~SqliteStore() override;

  std::string server_id() const override { return server_id_; }
  StoreHealth Health() const override;

  absl::StatusOr<std::vector<AppendOutcome>> Append(absl::Span<const Delivery> deliveries) override;
  absl::Status Compact(const std::function<absl::Status(double)>& progress) override;
  ReplicaSource* replica_source() override { return this; }
  ReplicaTarget* replica_target() override { return this; }

 private:
  explicit SqliteStore(const SqliteStoreOptions& options);
  absl::Status OpenDatabase();
  // RESOURCE_EXHAUSTED: the disk has less room than its reserve.
  absl::Status CheckRoom() const;
  absl::StatusOr<int64_t> ReadNumber(const char* pragma) const;
  void NoteSize() override;
  // For a database that was made before space could be given back in steps.
  absl::Status Rewrite();
  // Where the disk is full, again with the room that is kept for it.
  absl::Status Erase(const std::function<absl::Status()>& erase) override;

  SqliteStoreOptions options_;
  std::string server_id_;
  std::unique_ptr<DataDirectory> directory_;  // outlives the connections: it holds the lock
  std::unique_ptr<SqliteWriter> writer_;
  std::unique_ptr<SqliteReader> reader_;
  std::unique_ptr<SQLite::Statement> count_unused_pages_;  // used in the writer's transactions only
  std::atomic<uint64_t> unused_bytes_ = 0;
};

}  // namespace rigcal::server
