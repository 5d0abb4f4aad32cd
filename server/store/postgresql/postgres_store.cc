// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_store.h"

#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/postgresql/postgres_reader.h"
#include "server/store/postgresql/postgres_schema.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::milliseconds kAttendInterval{500};
constexpr int kSizeInterval = 20;  // of the intervals above

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresStore>> PostgresStore::Open(
    const PostgresStoreOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(const PostgresAddress address, PostgresAddress::Parse(options.url));
  std::unique_ptr<PostgresStore> store(new PostgresStore());
  RIGCAL_ASSIGN_OR_RETURN(store->writer_, PostgresWriter::Open(address, options.writer));
  RIGCAL_ASSIGN_OR_RETURN(store->reader_, PostgresReader::Open(address));
  try {
    RIGCAL_RETURN_IF_ERROR(
        CheckNoTransactionPooler(store->writer_->connection(), store->reader_->connection()));
  } catch (const PostgresError& error) {
    return StatusFromPostgres(error, "looking for a pooler", address.text());
  }
  store->Use(store->writer_.get(), store->reader_.get());
  store->ReadSize();
  store->attendant_ = std::thread([attended = store.get()] { attended->Attend(); });
  return store;
}

PostgresStore::~PostgresStore() {
  {
    const std::lock_guard lock(mutex_);
    end_ = true;
  }
  ended_.notify_all();
  if (attendant_.joinable()) attendant_.join();
  ForgetStatements();
}

std::string PostgresStore::server_id() const { return writer_->server_id(); }

StoreHealth PostgresStore::Health() const {
  StoreHealth health{
      .kind = "postgresql", .schema_version = kPostgresSchemaVersion, .counts_unused = false};
  health.size_bytes = size_bytes_;
  health.problem = writer_->problem();
  health.replaced = writer_->replaced();
  health.read_problem = reader_->problem();
  return health;
}

absl::Status PostgresStore::Compact(const std::function<absl::Status(double)>&) {
  return absl::UnimplementedError(
      "PostgreSQL uses the space of what was deleted again by itself; to give it back to the disk, "
      "stop this server and run `vacuumdb -f` on its database");
}

void PostgresStore::NoteForeignNumbers(SqlDatabase& database) {
  for (const char* table : {"session_camera", "stream"}) {
    SqlStatement row(database,
                     absl::StrCat("SELECT setval(pg_get_serial_sequence('", table,
                                  "', 'id'), coalesce(max(id), 0) + 1, false) FROM ", table));
    row.Step();
  }
}

void PostgresStore::Attend() {
  std::unique_lock lock(mutex_);
  for (int round = 1; !ended_.wait_for(lock, kAttendInterval, [this] { return end_; }); ++round) {
    lock.unlock();
    writer_->Recover();
    if (round % kSizeInterval == 0) ReadSize();
    lock.lock();
  }
}

void PostgresStore::ReadSize() {
  const absl::StatusOr<uint64_t> size = reader_->Read(
      "reading the size of the database", [](SqlDatabase& database) -> absl::StatusOr<uint64_t> {
        SqlStatement row(database, "SELECT pg_database_size(current_database())");
        return row.Step() ? row.Uint64(0) : 0;
      });
  if (size.ok()) size_bytes_ = *size;
}

absl::StatusOr<DatabaseReport> CheckPostgresDatabase(const std::string& url,
                                                     const CareProgress& progress) {
  RIGCAL_ASSIGN_OR_RETURN(PostgresAddress address, PostgresAddress::Parse(url));
  // A standby can be checked as well.
  address = address.With("target_session_attrs", "any");
  RIGCAL_ASSIGN_OR_RETURN(const auto reader, PostgresReader::Open(address));
  try {
    RIGCAL_RETURN_IF_ERROR(CheckPostgresSchema(reader->connection()));
  } catch (const PostgresError& error) {
    return StatusFromPostgres(error, "reading the schema", address.text());
  }
  DatabaseReport report;
  RIGCAL_RETURN_IF_ERROR(reader->ReadWith("checking the database", [&](SqlDatabase& database) {
    report = {};
    CheckTables(database, progress, &report);
    return absl::OkStatus();
  }));
  return report;
}

}  // namespace rigcal::server
