// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/activation.h"
#include "server/store/record_list.h"

// Which calibration of a rig is active, and which ones were, in the database. Each function runs
// inside a transaction of the caller's and may throw SQLite::Exception. Errors as in Store.
namespace rigcal::server {

// What version 5 of the schema has added.
extern const char kActivationTable[];

std::vector<RigSummary> ListRigs(SQLite::Database& database);
// ABORTED: another calibration is active than `previous_calibration_id`.
absl::StatusOr<Activation> InsertActivation(SQLite::Database& database, Activation activation);
absl::StatusOr<std::vector<Activation>> ListActivations(SQLite::Database& database,
                                                        std::string_view rig, int limit);
// Empty: none.
std::string ActiveCalibration(SQLite::Database& database, std::string_view rig);

}  // namespace rigcal::server
