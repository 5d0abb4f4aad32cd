// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/sqlite_store.h"

#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/sqlite/calibration_table.h"
#include "server/store/sqlite/data_directory.h"
#include "server/store/sqlite/observation_reader.h"
#include "server/store/sqlite/observation_writer.h"
#include "server/store/sqlite/session_table.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_schema.h"

namespace rigcal::server {
namespace {

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
  RIGCAL_RETURN_IF_ERROR(store->OpenDatabase());
  store->directory_->FillReserve(options.reserve_bytes);
  return store;
}

SqliteStore::SqliteStore(const SqliteStoreOptions& options) : options_(options) {}

SqliteStore::~SqliteStore() = default;

absl::Status SqliteStore::OpenDatabase() {
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
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(directory_->path(), error);
  if (!error) health.free_bytes = space.available;
  return health;
}

absl::Status SqliteStore::ChangeSessions(std::string_view what,
                                         const std::function<absl::Status()>& change) {
  return writer_->Transact(what, [&] {
    observations_->Forget();
    return change();
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

absl::StatusOr<std::vector<Listed<Session>>> SqliteStore::ListSessions(const SessionFilter& filter,
                                                                       const ListPage& page) const {
  return reader_->Read("listing sessions", [&](SQLite::Database& database) {
    return server::ListSessions(database, filter, page);
  });
}

absl::Status SqliteStore::DeleteSession(std::string_view id) {
  return EraseOnAnyDisk([&] {
    return ChangeSessions(absl::StrCat("deleting session ", std::string(id)),
                          [&] { return EraseSession(writer_->database(), id); });
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
  std::vector<AppendOutcome> outcomes;
  RIGCAL_RETURN_IF_ERROR(writer_->Transact(
      "storing observations",
      [&] {
        observations_->Append(deliveries, &outcomes);
        return absl::OkStatus();
      },
      [&] { observations_->Forget(); }));
  return outcomes;
}

absl::StatusOr<StreamStatus> SqliteStore::GetStream(const StreamKey& stream) const {
  return reader_->Read("reading a stream's position", [&](SQLite::Database& database) {
    return ReadStreamStatus(database, stream);
  });
}

absl::Status SqliteStore::ReadObservations(
    std::string_view session_id, std::string_view camera,
    const std::function<absl::Status(StoredBatch)>& visit) const {
  return server::ReadObservations(*reader_, session_id, camera, visit);
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
  return reader_->Read("listing calibrations", [&](SQLite::Database& database) {
    return server::ListCalibrations(database, filter, page);
  });
}

absl::Status SqliteStore::DeleteCalibration(std::string_view id) {
  return EraseOnAnyDisk([&] {
    return writer_->Transact(absl::StrCat("deleting calibration ", std::string(id)),
                             [&] { return EraseCalibration(writer_->database(), id); });
  });
}

}  // namespace rigcal::server
