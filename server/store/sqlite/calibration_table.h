// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration_record.h"
#include "server/store/record_list.h"

// Calibrations in the database. Each function runs inside a transaction of the caller's and may
// throw SQLite::Exception. Errors as in Store.
namespace rigcal::server {

absl::StatusOr<Calibration> InsertCalibration(SQLite::Database& database, Calibration calibration);
absl::Status ReplaceCalibration(SQLite::Database& database, const Calibration& calibration);
absl::StatusOr<Calibration> FindCalibration(SQLite::Database& database, std::string_view id);
std::vector<Listed<Calibration>> ListCalibrations(SQLite::Database& database,
                                                  const CalibrationFilter& filter,
                                                  const ListPage& page);
// Makes the summaries of all calibrations whose records can be read.
void SummarizeCalibrations(SQLite::Database& database);
// FAILED_PRECONDITION: it is queued or running.
absl::Status EraseCalibration(SQLite::Database& database, std::string_view id);

}  // namespace rigcal::server
