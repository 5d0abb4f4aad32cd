// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/calibration_table.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_wire.h"
#include "server/store/sqlite/record_checksum.h"
#include "server/store/sqlite/record_table.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_schema.h"

namespace rigcal::server {
namespace {

absl::Status NoCalibration(std::string_view id) {
  return absl::NotFoundError(absl::StrCat("no calibration ", std::string(id)));
}

absl::StatusOr<Calibration> ParseCalibrationRow(SQLite::Statement& row) {
  return ParseRecord(row, "calibration", wire::ParseCalibration);
}

bool HasEnded(CalibrationState state) {
  return state == CalibrationState::kSucceeded || state == CalibrationState::kFailed;
}

// FAILED_PRECONDITION: it has ended. INVALID_ARGUMENT: rig or version differ from what is stored.
absl::Status CheckReplacement(SQLite::Database& database, const Calibration& calibration) {
  SQLite::Statement query(database, "SELECT state, rig, version FROM calibration WHERE id=?");
  BindText(query, 1, calibration.id);
  if (!query.executeStep()) return NoCalibration(calibration.id);
  const auto state = static_cast<CalibrationState>(query.getColumn(0).getInt());
  if (HasEnded(state)) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", calibration.id, " has ",
                     state == CalibrationState::kSucceeded ? "succeeded" : "failed",
                     " and is immutable; start a new calibration"));
  }
  if (query.getColumn(1).getString() != calibration.rig ||
      ColumnUint32(query, 2) != calibration.version) {
    return absl::InvalidArgumentError(
        absl::StrCat("calibration ", calibration.id, " keeps its rig and its version"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Calibration> InsertCalibration(SQLite::Database& database, Calibration calibration) {
  const int64_t number = NextNumber(database, "calibration");
  calibration.id = absl::StrFormat("c-%06d", number);
  calibration.version = NextNumber(database, absl::StrCat("version of rig ", calibration.rig));
  const std::string body = wire::SerializeCalibration(calibration);
  SQLite::Statement insert(database,
                           "INSERT INTO calibration(number, id, rig, version, state, body, "
                           "checksum) VALUES(?,?,?,?,?,?,?)");
  insert.bind(1, number);
  BindText(insert, 2, calibration.id);
  BindText(insert, 3, calibration.rig);
  insert.bind(4, calibration.version);
  insert.bind(5, static_cast<int>(calibration.state));
  BindBlob(insert, 6, body);
  insert.bind(7, Checksum(body));
  insert.exec();
  SQLite::Statement relate(
      database,
      "INSERT OR IGNORE INTO calibration_session(session_id, calibration_number) "
      "VALUES(?,?)");
  for (const std::string& session_id : calibration.session_ids) {
    BindText(relate, 1, session_id);
    relate.bind(2, number);
    relate.exec();
    relate.reset();
  }
  return calibration;
}

absl::Status ReplaceCalibration(SQLite::Database& database, const Calibration& calibration) {
  RIGCAL_RETURN_IF_ERROR(CheckReplacement(database, calibration));
  const std::string body = wire::SerializeCalibration(calibration);
  SQLite::Statement update(database,
                           "UPDATE calibration SET state=?, body=?, checksum=? WHERE id=?");
  update.bind(1, static_cast<int>(calibration.state));
  BindBlob(update, 2, body);
  update.bind(3, Checksum(body));
  BindText(update, 4, calibration.id);
  update.exec();
  return absl::OkStatus();
}

absl::StatusOr<Calibration> FindCalibration(SQLite::Database& database, std::string_view id) {
  SQLite::Statement query(database, "SELECT id, body, checksum FROM calibration WHERE id=?");
  BindText(query, 1, id);
  if (!query.executeStep()) return NoCalibration(id);
  return ParseCalibrationRow(query);
}

absl::StatusOr<std::vector<Listed<Calibration>>> ListCalibrations(SQLite::Database& database,
                                                                  const CalibrationFilter& filter,
                                                                  const ListPage& page) {
  std::vector<RecordCondition> conditions;
  if (!filter.rig.empty()) conditions.push_back({"rig=?", std::string_view(filter.rig)});
  if (filter.state) conditions.push_back({"state=?", static_cast<int64_t>(*filter.state)});
  if (!filter.session_id.empty()) {
    conditions.push_back(
        {"number IN (SELECT calibration_number FROM calibration_session WHERE session_id=?)",
         std::string_view(filter.session_id)});
  }
  std::vector<Listed<Calibration>> calibrations;
  const auto take = [&](SQLite::Statement& row, RecordPosition position) -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, ParseCalibrationRow(row));
    // Megabytes each with many cameras; only a calibration asked for by its id needs it.
    if (calibration.result) calibration.result->camera_covariance = {};
    calibrations.push_back({std::move(calibration), std::move(position)});
    return absl::OkStatus();
  };
  RIGCAL_RETURN_IF_ERROR(ForEachRecord(database, "calibration", std::move(conditions), page, take));
  return calibrations;
}

absl::Status EraseCalibration(SQLite::Database& database, std::string_view id) {
  SQLite::Statement query(database, "SELECT state FROM calibration WHERE id=?");
  BindText(query, 1, id);
  if (!query.executeStep()) return NoCalibration(id);
  if (!HasEnded(static_cast<CalibrationState>(query.getColumn(0).getInt()))) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", std::string(id),
                     " cannot be deleted: it is queued or running; cancel it first"));
  }
  SQLite::Statement erase(database, "DELETE FROM calibration WHERE id=?");
  BindText(erase, 1, id);
  erase.exec();
  return absl::OkStatus();
}

}  // namespace rigcal::server
