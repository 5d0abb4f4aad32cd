// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/calibration_table.h"

#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "common/wire/calibration_wire.h"
#include "server/store/sql/activation_table.h"
#include "server/store/sql/counter_table.h"
#include "server/store/sql/record_table.h"

namespace rigcal::server {
namespace {

constexpr char kCalibration[] = "calibration";

// Its number. FAILED_PRECONDITION: it has ended. INVALID_ARGUMENT: rig or version differ from what
// is stored.
absl::StatusOr<int64_t> CheckReplacement(SqlDatabase& database, const Calibration& calibration) {
  SqlStatement row = Query(
      database, "SELECT state, rig, version, number FROM calibration WHERE id=?", calibration.id);
  if (!row.Step()) return NoRecord(kCalibration, calibration.id);
  const auto state = static_cast<CalibrationState>(row.Int64(0));
  if (HasEnded(state)) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", calibration.id, " ",
                     state == CalibrationState::kSucceeded ? "has succeeded"
                     : state == CalibrationState::kFailed  ? "has failed"
                                                           : "was cancelled",
                     " and is immutable; start a new calibration"));
  }
  if (row.Text(1) != calibration.rig || row.Uint32(2) != calibration.version) {
    return absl::InvalidArgumentError(
        absl::StrCat("calibration ", calibration.id, " keeps its rig and its version"));
  }
  return row.Int64(3);
}

// Cameras, refusals and the covariance are megabytes with many cameras; only a calibration asked
// for by its id needs them.
Calibration WithoutLists(Calibration calibration) {
  calibration.refused.clear();
  if (calibration.result) {
    calibration.result->cameras.clear();
    calibration.result->refused.clear();
    calibration.result->camera_covariance.clear();
    calibration.result->residuals.clear();
  }
  return calibration;
}

absl::StatusOr<Calibration> SummarizeCalibration(SqlDatabase& database, std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, FindCalibration(database, id));
  return WithoutLists(std::move(calibration));
}

Calibration BlankCalibration(SqlStatement& row) {
  Calibration calibration;
  calibration.id = row.Text(0);
  calibration.rig = row.Text(4);
  calibration.state = static_cast<CalibrationState>(row.Int64(5));
  calibration.version = row.Uint32(7);
  return calibration;
}

constexpr SummarySource<Calibration> kCalibrationSummaries = {.table = kCalibration,
                                                              .more = "version",
                                                              .parse = wire::ParseCalibration,
                                                              .summarize = SummarizeCalibration,
                                                              .blank = BlankCalibration};

void PutCalibrationSummary(SqlDatabase& database, int64_t number, const Calibration& calibration) {
  PutSummary(database, kCalibration, number, wire::SerializeCalibration(WithoutLists(calibration)));
}

}  // namespace

absl::StatusOr<Calibration> InsertCalibration(SqlDatabase& database, Calibration calibration) {
  const int64_t number = NextNumber(database, kCalibration);
  calibration.id = absl::StrFormat("c-%06d", number);
  calibration.version = NextNumber(database, absl::StrCat("version of rig ", calibration.rig));
  const std::string body = wire::SerializeCalibration(calibration);
  Query(database,
        "INSERT INTO calibration(number, id, rig, version, state, body, checksum) "
        "VALUES(?,?,?,?,?,?,?)",
        number, calibration.id, calibration.rig, calibration.version, calibration.state, Blob{body},
        Checksum(body))
      .Run();
  PutCalibrationSummary(database, number, calibration);
  if (!HasEnded(calibration.state)) {
    Query(database,
          "INSERT INTO calibration_job(calibration_number, state, software_version) VALUES(?,?,?)",
          number, calibration.state, calibration.software_version)
        .Run();
  }
  SqlStatement relate(database,
                      "INSERT INTO calibration_session(session_id, calibration_number) VALUES(?,?) "
                      "ON CONFLICT DO NOTHING");
  for (const std::string& session_id : calibration.session_ids) {
    Execute(relate, session_id, number);
  }
  return calibration;
}

absl::Status ReplaceCalibration(SqlDatabase& database, const Calibration& calibration) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, CheckReplacement(database, calibration));
  const std::string body = wire::SerializeCalibration(calibration);
  Query(database, "UPDATE calibration SET state=?, body=?, checksum=? WHERE id=?",
        calibration.state, Blob{body}, Checksum(body), calibration.id)
      .Run();
  Query(database, "UPDATE calibration_job SET state=? WHERE calibration_number=?",
        calibration.state, number)
      .Run();
  PutCalibrationSummary(database, number, calibration);
  return absl::OkStatus();
}

absl::StatusOr<Calibration> FindCalibration(SqlDatabase& database, std::string_view id) {
  return FindRecord(database, kCalibration, id, wire::ParseCalibration);
}

std::vector<Listed<Calibration>> ListCalibrations(SqlDatabase& database,
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
  return ListSummaries(database, kCalibrationSummaries, std::move(conditions), page);
}

void SummarizeCalibrations(SqlDatabase& database) {
  SqlStatement row(database, "SELECT id, body, checksum, number FROM calibration");
  while (row.Step()) {
    const auto calibration = ParseRecord(row, kCalibration, wire::ParseCalibration);
    if (calibration.ok()) {
      PutCalibrationSummary(database, row.Int64(3), *calibration);
    }
  }
}

absl::Status EraseCalibration(SqlDatabase& database, std::string_view id) {
  SqlStatement row = Query(database, "SELECT state, rig FROM calibration WHERE id=?", id);
  if (!row.Step()) return NoRecord(kCalibration, id);
  if (!HasEnded(static_cast<CalibrationState>(row.Int64(0)))) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", std::string(id),
                     " cannot be deleted: it is queued or running; cancel it first"));
  }
  const std::string rig = row.Text(1);
  if (ActiveCalibration(database, rig) == id) {
    return absl::FailedPreconditionError(absl::StrCat(
        "calibration ", std::string(id), " cannot be deleted: it is the active one of rig '", rig,
        "'; activate another one first"));
  }
  Query(database, "DELETE FROM calibration WHERE id=?", id).Run();
  return absl::OkStatus();
}

}  // namespace rigcal::server
