// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/activation_table.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/wire/rig_wire.h"
#include "server/store/sqlite/record_table.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {
namespace {

constexpr char kActivation[] = "activation";

}  // namespace

const char kActivationTable[] = R"sql(
CREATE TABLE activation(
  rig TEXT NOT NULL,
  number INTEGER NOT NULL,
  calibration_id TEXT NOT NULL,
  body BLOB NOT NULL,
  checksum INTEGER NOT NULL,
  PRIMARY KEY(rig, number)
) WITHOUT ROWID;
)sql";

std::vector<RigSummary> ListRigs(SQLite::Database& database) {
  SQLite::Statement row(database,
                        "SELECT rig, sum(n) FROM ("
                        "SELECT rig, count(*) AS n FROM calibration GROUP BY rig UNION ALL "
                        "SELECT DISTINCT rig, 0 FROM session) GROUP BY rig ORDER BY rig");
  std::vector<RigSummary> rigs;
  while (row.executeStep()) rigs.push_back({row.getColumn(0).getString(), ColumnUint32(row, 1)});
  return rigs;
}

std::string ActiveCalibration(SQLite::Database& database, std::string_view rig) {
  SQLite::Statement row =
      Query(database,
            "SELECT calibration_id FROM activation WHERE rig=? ORDER BY number DESC LIMIT 1", rig);
  return row.executeStep() ? row.getColumn(0).getString() : std::string();
}

absl::StatusOr<Activation> InsertActivation(SQLite::Database& database, Activation activation) {
  const std::string active = ActiveCalibration(database, activation.rig);
  if (active != activation.previous_calibration_id) {
    return absl::AbortedError(absl::StrCat(
        "calibration ", active, " has become the active one of rig '", activation.rig,
        "' meanwhile; look at `rigcal rig history` and do it again if it is still right"));
  }
  SQLite::Statement last = Query(
      database, "SELECT coalesce(max(number), 0) FROM activation WHERE rig=?", activation.rig);
  last.executeStep();
  activation.number = ColumnUint32(last, 0) + 1;
  const std::string body = wire::SerializeActivation(activation);
  Query(database,
        "INSERT INTO activation(rig, number, calibration_id, body, checksum) VALUES(?,?,?,?,?)",
        activation.rig, static_cast<int64_t>(activation.number), activation.calibration_id,
        Blob{body}, Checksum(body))
      .exec();
  return activation;
}

absl::StatusOr<std::vector<Activation>> ListActivations(SQLite::Database& database,
                                                        std::string_view rig, int limit) {
  SQLite::Statement row =
      Query(database,
            "SELECT rig || ' ' || number, body, checksum FROM activation WHERE rig=? "
            "ORDER BY number DESC LIMIT ?",
            rig, static_cast<int64_t>(limit));
  std::vector<Activation> activations;
  while (row.executeStep()) {
    RIGCAL_ASSIGN_OR_RETURN(Activation activation,
                            ParseRecord(row, kActivation, wire::ParseActivation));
    activations.push_back(std::move(activation));
  }
  return activations;
}

}  // namespace rigcal::server
