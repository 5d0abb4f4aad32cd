// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/sqlite_store.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/row_account.h"
#include "server/store/sqlite/activation_table.h"
#include "server/store/sqlite/calibration_table.h"
#include "server/store/sqlite/damage_note.h"
#include "server/store/sqlite/data_directory.h"
#include "server/store/sqlite/observation_reader.h"
#include "server/store/sqlite/observation_writer.h"
#include "server/store/sqlite/session_table.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_schema.h"

namespace rigcal::server {
namespace {

// One step of compacting: a few milliseconds.
constexpr int kCompactPages = 512;
constexpr int64_t kIncrementalVacuum = 2;

std::string Mebibytes(uint64_t bytes) { return absl::StrCat(bytes >> 20, " MiB"); }

uint64_t FileSize(const std::filesystem::path& path) {
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(path, error);
  return error ? 0 : size;
}

}  // namespace

absl::StatusOr<std::unique_ptr<SqliteStore>> SqliteStore::Open(const SqliteStoreOptions& options) {
  if (options.data_directory.empty()) {
    return absl::InvalidArgumentError("data_directory is empty");
  }
  std::unique_ptr<SqliteStore> store(new SqliteStore(options));
  RIGCAL_ASSIGN_OR_RETURN(store->directory_, DataDirectory::Open(options.data_directory));
  absl::Status opened = store->OpenDatabase();
  if (absl::IsResourceExhausted(opened)) {
    // A database of an earlier release is brought up to date, which takes room.
    store->directory_->ReleaseReserve();
    opened = store->OpenDatabase();
  }
  RIGCAL_RETURN_IF_ERROR(opened);
  store->directory_->FillReserve(options.reserve_bytes);
  return store;
}

SqliteStore::SqliteStore(const SqliteStoreOptions& options) : options_(options) {}

SqliteStore::~SqliteStore() = default;

absl::Status SqliteStore::OpenDatabase() {
  // What an attempt before has left, statements before their connection.
  count_unused_pages_.reset();
  observations_.reset();
  reader_.reset();
  writer_.reset();
  const std::filesystem::path file = directory_->database_file();
  RIGCAL_ASSIGN_OR_RETURN(writer_,
                          SqliteWriter::Open(file, options_.vfs, options_.checkpoint_bytes));
  absl::Status prepared = writer_->Transact("preparing the database", [&]() -> absl::Status {
    RIGCAL_RETURN_IF_ERROR(PrepareSchema(writer_->database(), file.string()));
    RIGCAL_ASSIGN_OR_RETURN(server_id_, ReadServerId(writer_->database()));
    return absl::OkStatus();
  });
  if (!prepared.ok()) return prepared;
  try {
    observations_ = std::make_unique<ObservationWriter>(writer_->database());
    count_unused_pages_ = std::make_unique<SQLite::Statement>(
        writer_->database(),
        "SELECT freelist_count, page_size FROM pragma_freelist_count, pragma_page_size");
    NoteUnusedPages();
  } catch (const SQLite::Exception& error) {
    return StatusFromSqlite(error, "preparing statements");
  }
  RIGCAL_ASSIGN_OR_RETURN(reader_, SqliteReader::Open(file, options_.vfs));
  return absl::OkStatus();
}

StoreHealth SqliteStore::Health() const {
  StoreHealth health{.kind = "sqlite", .schema_version = kSchemaVersion};
  const std::filesystem::path file = directory_->database_file();
  health.size_bytes = FileSize(file) + FileSize(file.string() + "-wal");
  health.free_bytes = directory_->FreeBytes().value_or(0);
  health.reserve_bytes = options_.min_free_bytes;
  health.problem = std::string(writer_->problem().message());
  health.read_problem = reader_->problem();
  health.unused_bytes = unused_bytes_;
  return health;
}

void SqliteStore::NoteUnusedPages() {
  const StatementScope scope(*count_unused_pages_);
  count_unused_pages_->executeStep();
  unused_bytes_ = ColumnUint64(*count_unused_pages_, 0) * ColumnUint64(*count_unused_pages_, 1);
}

absl::StatusOr<int64_t> SqliteStore::ReadNumber(const char* pragma) const {
  return reader_->Read("reading the size of the database",
                       [&](SQLite::Database& database) -> absl::StatusOr<int64_t> {
                         return database.execAndGet(absl::StrCat("PRAGMA ", pragma)).getInt64();
                       });
}

absl::Status SqliteStore::CheckRoom() const {
  const std::optional<uint64_t> free_bytes = directory_->FreeBytes();
  // Deleting gives no space back to the disk, but into the database, where it is used again.
  if (!free_bytes || *free_bytes + unused_bytes_ >= options_.min_free_bytes) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(absl::StrCat(
      "no observations are stored: the disk of ", directory_->path().string(), " has ",
      Mebibytes(*free_bytes), " left, and ", Mebibytes(options_.min_free_bytes),
      " are its reserve; free space, delete sessions, or lower ", "limits.disk_reserve_mb"));
}

absl::Status SqliteStore::ChangeSessions(std::string_view what,
                                         const std::function<absl::Status()>& change) {
  return writer_->Transact(what, [&] {
    observations_->Forget();
    absl::Status status = change();
    NoteUnusedPages();
    return status;
  });
}

absl::StatusOr<Session> SqliteStore::CreateSession(Session session) {
  RIGCAL_RETURN_IF_ERROR(ChangeSessions("storing a session", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(session, InsertSession(writer_->database(), std::move(session)));
    return absl::OkStatus();
  }));
  return session;
}

absl::Status SqliteStore::UpdateSession(const Session& session) {
  return ChangeSessions(absl::StrCat("storing session ", session.id),
                        [&] { return ReplaceSession(writer_->database(), session); });
}

absl::StatusOr<Session> SqliteStore::GetSession(std::string_view id) const {
  return reader_->Read("reading a session",
                       [&](SQLite::Database& database) { return FindSession(database, id); });
}

absl::StatusOr<std::vector<Listed<SessionSummary>>> SqliteStore::ListSessions(
    const SessionFilter& filter, const ListPage& page) const {
  return reader_->Read(
      "listing sessions",
      [&](SQLite::Database& database) -> absl::StatusOr<std::vector<Listed<SessionSummary>>> {
        return server::ListSessions(database, filter, page);
      });
}

absl::Status SqliteStore::DeleteSession(std::string_view id) {
  return EraseOnAnyDisk([&] {
    return ChangeSessions(absl::StrCat("deleting session ", std::string(id)),
                          [&] { return EraseSession(writer_->database(), id); });
  });
}

absl::Status SqliteStore::DeleteObservations(std::string_view id, int64_t utc_ns) {
  return EraseOnAnyDisk([&] {
    return ChangeSessions(absl::StrCat("deleting the observations of session ", std::string(id)),
                          [&] { return EraseObservations(writer_->database(), id, utc_ns); });
  });
}

absl::Status SqliteStore::EraseOnAnyDisk(const std::function<absl::Status()>& erase) {
  absl::Status status = erase();
  if (absl::IsResourceExhausted(status)) {
    // Deleting writes to the log first. The reserve makes room for that, and the checkpoint empties
    // the log.
    directory_->ReleaseReserve();
    RIGCAL_RETURN_IF_ERROR(writer_->Checkpoint());
    status = erase();
    if (!status.ok()) return status;
    RIGCAL_RETURN_IF_ERROR(writer_->Checkpoint());
  }
  directory_->FillReserve(options_.reserve_bytes);
  return status;
}

absl::StatusOr<std::vector<SessionCameraCounts>> SqliteStore::GetSessionCounts(
    std::string_view id) const {
  return reader_->Read("reading counts",
                       [&](SQLite::Database& database) { return ReadSessionCounts(database, id); });
}

absl::StatusOr<std::vector<AppendOutcome>> SqliteStore::Append(
    absl::Span<const Delivery> deliveries) {
  // What has no rows is small: the beginnings and ends of streams are noted as long as they fit.
  if (std::ranges::any_of(deliveries, [](const Delivery& one) { return one.batch.rows() > 0; })) {
    RIGCAL_RETURN_IF_ERROR(CheckRoom());
  }
  std::vector<AppendOutcome> outcomes;
  const auto append = [&] {
    outcomes.clear();
    return writer_->Transact(
        "storing observations",
        [&] {
          observations_->Append(deliveries, &outcomes);
          NoteUnusedPages();
          return absl::OkStatus();
        },
        [&] { observations_->Forget(); });
  };
  absl::Status status = append();
  if (absl::IsResourceExhausted(status) && unused_bytes_ > 0) {
    // The log is full, and not the database: emptied, it has room for the next.
    RIGCAL_RETURN_IF_ERROR(writer_->CheckpointWithoutWaiting());
    status = append();
  }
  RIGCAL_RETURN_IF_ERROR(status);
  return outcomes;
}

absl::StatusOr<StreamStatus> SqliteStore::GetStream(const StreamKey& stream) const {
  return reader_->Read("reading a stream's position", [&](SQLite::Database& database) {
    return ReadStreamStatus(database, stream);
  });
}

absl::StatusOr<std::vector<StreamAudit>> SqliteStore::AuditStreams(std::string_view id) const {
  RIGCAL_ASSIGN_OR_RETURN(std::vector<AuditedStream> streams,
                          reader_->Read("counting stored rows", [&](SQLite::Database& database) {
                            return ListAuditedStreams(database, id);
                          }));
  std::vector<RowAccount> accounts;
  for (AuditedStream& stream : streams) {
    accounts.emplace_back(stream.audit, stream.dropped, stream.last_first_seq);
  }
  // Both are in the same order; a stream that began meanwhile is in the rows only.
  size_t current = 0;
  RIGCAL_RETURN_IF_ERROR(ReadObservations(id, "", [&](const StoredBatch& stored) {
    const StreamKey& key = stored.batch.stream;
    const size_t from = current;
    while (current < streams.size() && streams[current].audit.stream != key) ++current;
    if (current == streams.size()) {
      current = from;
    } else {
      accounts[current].Add(stored);
    }
    return absl::OkStatus();
  }));
  std::vector<StreamAudit> audits;
  for (RowAccount& account : accounts) audits.push_back(std::move(account).Close());
  return audits;
}

absl::Status SqliteStore::ReadObservations(
    std::string_view session_id, std::string_view camera,
    const std::function<absl::Status(StoredBatch)>& visit) const {
  RIGCAL_ASSIGN_OR_RETURN(const auto cursor, OpenObservations(session_id, camera));
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(std::optional<StoredBatch> stored, cursor->Next());
    if (!stored) return absl::OkStatus();
    RIGCAL_RETURN_IF_ERROR(visit(*std::move(stored)));
  }
}

void SqliteStore::NoteDamagedBatches(const std::vector<DamageNote>& damaged) const {
  if (damaged.empty()) return;
  const auto added = reader_->Read(
      "reading counts", [&](SQLite::Database& database) -> absl::StatusOr<std::vector<DamageNote>> {
        return NewDamage(database, damaged);
      });
  if (!added.ok() || added->empty()) return;
  spdlog::error("{} stored batches are damaged and left out, the first: {}", added->size(),
                added->front().example);
  const absl::Status noted = writer_->Transact("counting damaged observations", [&] {
    NoteDamage(writer_->database(), *added);
    return absl::OkStatus();
  });
  // What reads them counts them itself; the next one tries to note them again.
  if (!noted.ok()) spdlog::warn("{}", std::string(noted.message()));
}

absl::StatusOr<std::unique_ptr<ObservationCursor>> SqliteStore::OpenObservations(
    std::string_view session_id, std::string_view camera) const {
  return server::OpenObservations(
      *reader_, session_id, camera,
      [this](const std::vector<DamageNote>& damaged) { NoteDamagedBatches(damaged); });
}

absl::StatusOr<Calibration> SqliteStore::CreateCalibration(Calibration calibration) {
  RIGCAL_RETURN_IF_ERROR(writer_->Transact("storing a calibration", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(calibration,
                            InsertCalibration(writer_->database(), std::move(calibration)));
    return absl::OkStatus();
  }));
  return calibration;
}

absl::Status SqliteStore::UpdateCalibration(const Calibration& calibration) {
  return writer_->Transact(absl::StrCat("storing calibration ", calibration.id),
                           [&] { return ReplaceCalibration(writer_->database(), calibration); });
}

absl::StatusOr<Calibration> SqliteStore::GetCalibration(std::string_view id) const {
  return reader_->Read("reading a calibration",
                       [&](SQLite::Database& database) { return FindCalibration(database, id); });
}

absl::StatusOr<std::vector<Listed<Calibration>>> SqliteStore::ListCalibrations(
    const CalibrationFilter& filter, const ListPage& page) const {
  return reader_->Read(
      "listing calibrations",
      [&](SQLite::Database& database) -> absl::StatusOr<std::vector<Listed<Calibration>>> {
        return server::ListCalibrations(database, filter, page);
      });
}

absl::Status SqliteStore::DeleteCalibration(std::string_view id) {
  return EraseOnAnyDisk([&] {
    return writer_->Transact(absl::StrCat("deleting calibration ", std::string(id)), [&] {
      absl::Status status = EraseCalibration(writer_->database(), id);
      NoteUnusedPages();
      return status;
    });
  });
}

absl::StatusOr<std::vector<RigSummary>> SqliteStore::ListRigs() const {
  return reader_->Read("listing rigs",
                       [](SQLite::Database& database) -> absl::StatusOr<std::vector<RigSummary>> {
                         return server::ListRigs(database);
                       });
}

absl::StatusOr<Activation> SqliteStore::AddActivation(Activation activation) {
  RIGCAL_RETURN_IF_ERROR(writer_->Transact("storing an activation", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(activation, InsertActivation(writer_->database(), activation));
    return absl::OkStatus();
  }));
  return activation;
}

absl::StatusOr<std::vector<Activation>> SqliteStore::ListActivations(std::string_view rig,
                                                                     int limit) const {
  return reader_->Read("reading a rig's history", [&](SQLite::Database& database) {
    return server::ListActivations(database, rig, limit);
  });
}

absl::Status SqliteStore::Compact(const std::function<absl::Status(double)>& progress) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t mode, ReadNumber("auto_vacuum"));
  RIGCAL_RETURN_IF_ERROR(progress(0));
  if (mode != kIncrementalVacuum) RIGCAL_RETURN_IF_ERROR(Rewrite());
  RIGCAL_ASSIGN_OR_RETURN(const int64_t unused, ReadNumber("freelist_count"));
  int64_t left = unused;
  while (left > 0) {
    RIGCAL_RETURN_IF_ERROR(writer_->Transact("compacting", [&] {
      writer_->database().exec(absl::StrCat("PRAGMA incremental_vacuum(", kCompactPages, ")"));
      NoteUnusedPages();
      return absl::OkStatus();
    }));
    const int64_t before = left;
    RIGCAL_ASSIGN_OR_RETURN(left, ReadNumber("freelist_count"));
    if (left >= before) break;  // others delete at the same time
    RIGCAL_RETURN_IF_ERROR(
        progress(static_cast<double>(unused - left) / static_cast<double>(unused)));
  }
  RIGCAL_RETURN_IF_ERROR(writer_->CheckpointWithoutWaiting());
  return progress(1);
}

absl::Status SqliteStore::Rewrite() {
  const StoreHealth health = Health();
  // The copy, and the log that it is written back through.
  const uint64_t needed = 2 * health.size_bytes + options_.min_free_bytes;
  if (health.free_bytes < needed) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "this database was made by an earlier release, and compacting it for the first time needs ",
        Mebibytes(needed), " on the disk of ", directory_->path().string(), "; it has ",
        Mebibytes(health.free_bytes), " left: free space, or delete sessions"));
  }
  return writer_->RunAlone("compacting", [&] {
    writer_->database().exec("PRAGMA temp_store=FILE");
    writer_->database().exec("PRAGMA auto_vacuum=INCREMENTAL");
    writer_->database().exec("VACUUM");
    writer_->database().exec("PRAGMA temp_store=MEMORY");
  });
}

}  // namespace rigcal::server
