// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/activation.h"
#include "server/store/record_list.h"
#include "server/store/sql/sql_database.h"

// Which calibration of a rig is active, and which ones were, in the database. Each function runs
// inside a transaction of the caller's and may throw the database's errors. Errors as in Store.
namespace rigcal::server {

std::vector<RigSummary> ListRigs(SqlDatabase& database);
// ABORTED: another calibration is active than `previous_calibration_id`.
absl::StatusOr<Activation> InsertActivation(SqlDatabase& database, Activation activation);
absl::StatusOr<std::vector<Activation>> ListActivations(SqlDatabase& database, std::string_view rig,
                                                        int limit);
// Empty: none.
std::string ActiveCalibration(SqlDatabase& database, std::string_view rig);

}  // namespace rigcal::server
