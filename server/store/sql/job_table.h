// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration_record.h"
#include "server/store/calibration_job.h"
#include "server/store/sql/sql_database.h"

// The queue of calibrations, and who takes from it. Each function runs inside a transaction of the
// caller's, changes the row of the job before that of the calibration, and may throw the database's
// errors. Errors as in Store. Times are those of the database.
namespace rigcal::server {

// `lease_ms`: how long a claim lasts; 0: until jobs are adopted (one process has the store).
absl::StatusOr<std::optional<ClaimedJob>> ClaimJob(SqlDatabase& database, const JobHolder& holder,
                                                   const ClaimOptions& options, int64_t lease_ms);
absl::StatusOr<bool> RenewJob(SqlDatabase& database, const JobClaim& claim,
                              const JobProgress& progress, int64_t lease_ms);
absl::Status FinishJob(SqlDatabase& database, const JobClaim& claim,
                       const Calibration& calibration);
absl::StatusOr<Calibration> CancelJob(SqlDatabase& database, std::string_view id, int64_t utc_ns);
absl::StatusOr<std::vector<CalibrationJob>> ListJobs(SqlDatabase& database, int64_t lease_ms);
// `all`: also those of workers.
void AdoptJobs(SqlDatabase& database, std::string_view software_version, bool all,
               int64_t lease_ms);

void NoteWorker(SqlDatabase& database, const JobHolder& holder);
void ForgetWorker(SqlDatabase& database, const JobHolder& holder);
std::vector<SolveWorker> ListWorkers(SqlDatabase& database);

}  // namespace rigcal::server
