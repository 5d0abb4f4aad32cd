// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration_record.h"
#include "server/store/record_list.h"
#include "server/store/sql/sql_database.h"

// Calibrations in the database. Each function runs inside a transaction of the caller's and may
// throw the database's errors. Errors as in Store.
namespace rigcal::server {

absl::StatusOr<Calibration> InsertCalibration(SqlDatabase& database, Calibration calibration);
absl::Status ReplaceCalibration(SqlDatabase& database, const Calibration& calibration);
absl::StatusOr<Calibration> FindCalibration(SqlDatabase& database, std::string_view id);
std::vector<Listed<Calibration>> ListCalibrations(SqlDatabase& database,
                                                  const CalibrationFilter& filter,
                                                  const ListPage& page);
// Makes the summaries of all calibrations whose records can be read.
void SummarizeCalibrations(SqlDatabase& database);
// FAILED_PRECONDITION: it is queued or running.
absl::Status EraseCalibration(SqlDatabase& database, std::string_view id);

}  // namespace rigcal::server
