// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/activation_table.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/wire/rig_wire.h"
#include "server/store/sql/record_table.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {
namespace {

constexpr char kActivation[] = "activation";

}  // namespace

std::vector<RigSummary> ListRigs(SqlDatabase& database) {
  SqlStatement row(database,
                   "SELECT rig, CAST(sum(n) AS BIGINT) FROM ("
                   "SELECT rig, count(*) AS n FROM calibration GROUP BY rig UNION ALL "
                   "SELECT DISTINCT rig, 0 FROM session) AS rigs GROUP BY rig ORDER BY rig");
  std::vector<RigSummary> rigs;
  while (row.Step()) rigs.push_back({row.Text(0), row.Uint32(1)});
  return rigs;
}

std::string ActiveCalibration(SqlDatabase& database, std::string_view rig) {
  SqlStatement row =
      Query(database,
            "SELECT calibration_id FROM activation WHERE rig=? ORDER BY number DESC LIMIT 1", rig);
  return row.Step() ? row.Text(0) : std::string();
}

absl::StatusOr<Activation> InsertActivation(SqlDatabase& database, Activation activation) {
  const std::string active = ActiveCalibration(database, activation.rig);
  if (active != activation.previous_calibration_id) {
    return absl::AbortedError(absl::StrCat(
        "calibration ", active, " has become the active one of rig '", activation.rig,
        "' meanwhile; look at `rigcal rig history` and do it again if it is still right"));
  }
  SqlStatement last = Query(database, "SELECT coalesce(max(number), 0) FROM activation WHERE rig=?",
                            activation.rig);
  last.Step();
  activation.number = last.Uint32(0) + 1;
  const std::string body = wire::SerializeActivation(activation);
  Query(database,
        "INSERT INTO activation(rig, number, calibration_id, body, checksum) VALUES(?,?,?,?,?)",
        activation.rig, static_cast<int64_t>(activation.number), activation.calibration_id,
        Blob{body}, Checksum(body))
      .Run();
  return activation;
}

absl::StatusOr<std::vector<Activation>> ListActivations(SqlDatabase& database, std::string_view rig,
                                                        int limit) {
  SqlStatement row =
      Query(database,
            "SELECT rig || ' ' || number, body, checksum FROM activation WHERE rig=? "
            "ORDER BY number DESC LIMIT ?",
            rig, static_cast<int64_t>(limit));
  std::vector<Activation> activations;
  while (row.Step()) {
    RIGCAL_ASSIGN_OR_RETURN(Activation activation,
                            ParseRecord(row, kActivation, wire::ParseActivation));
    activations.push_back(std::move(activation));
  }
  return activations;
}

}  // namespace rigcal::server
