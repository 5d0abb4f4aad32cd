// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/job_table.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/sql/calibration_table.h"

namespace rigcal::server {
namespace {

constexpr auto kQueued = CalibrationState::kQueued;
constexpr auto kRunning = CalibrationState::kRunning;
constexpr int64_t kNever = std::numeric_limits<int64_t>::max();
constexpr double kPpm = 1e6;
// Workers that were killed leave their row behind.
constexpr int64_t kWorkerKeptMs = int64_t{24} * 3600 * 1000;
constexpr int64_t kNsPerMs = 1'000'000;

// A running job that another one may claim. Nobody makes a lease that ends later than one lease
// from now: where one does, the clock of the database was set back, and its holder may be gone.
std::string LeaseIsOver(SqlDatabase& database, int64_t lease_ms) {
  if (lease_ms == 0) return "lease_end_ms=0";
  const std::string now = database.NowMs();
  return absl::StrCat("(lease_end_ms<=", now, " OR lease_end_ms>", now, "+", 2 * lease_ms, ")");
}

std::string LeaseEnd(SqlDatabase& database, int64_t lease_ms) {
  if (lease_ms == 0) return absl::StrCat(kNever);
  return absl::StrCat(database.NowMs(), "+", lease_ms);
}

// Of a row with host, pid, version and is_server from `first` on.
JobHolder HolderOf(SqlStatement& row, int first) {
  return {.host = row.Text(first),
          .pid = row.Int64(first + 1),
          .software_version = row.Text(first + 2),
          .is_server = row.Int64(first + 3) != 0};
}

constexpr char kHolder[] = "holder_host, holder_pid, holder_version, holder_is_server";

int64_t Ppm(double fraction) { return std::llround(std::clamp(fraction, 0.0, 1.0) * kPpm); }

// Of a claim that counts no more.
absl::Status LostClaim(SqlDatabase& database, const JobClaim& claim) {
  SqlStatement row = Query(database,
                           absl::StrCat("SELECT state, ", kHolder,
                                        " FROM calibration_job WHERE "
                                        "calibration_number=?"),
                           claim.calibration_number);
  std::string now = "it is there no more";
  if (row.Step()) {
    const auto state = static_cast<CalibrationState>(row.Int64(0));
    if (state == kQueued) {
      now = "it waits for another one";
    } else {
      now = absl::StrCat(NameOf(HolderOf(row, 1)), state == kRunning ? " solves it" : " ended it");
    }
  }
  return absl::AbortedError(absl::StrCat(
      "calibration ", claim.calibration_id,
      " was claimed by another process after this one had not been heard of for longer than its "
      "lease; ",
      now, ", and nothing of this solve is stored"));
}

Calibration Cancelled(Calibration calibration, int64_t utc_ns) {
  calibration.state = CalibrationState::kCancelled;
  calibration.error = "cancelled";
  calibration.end_utc_ns = utc_ns;
  return calibration;
}

}  // namespace

absl::StatusOr<std::optional<ClaimedJob>> ClaimJob(SqlDatabase& database, const JobHolder& holder,
                                                   const ClaimOptions& options, int64_t lease_ms) {
  std::string id, last_holder;
  ClaimedJob job;
  int attempts = 0;
  {
    SqlStatement row(
        database,
        absl::StrCat("SELECT calibration_number, attempts, cancel, fence, ", kHolder,
                     " FROM calibration_job WHERE (state=1 OR (state=2 AND ",
                     LeaseIsOver(database, lease_ms), ")) AND ",
                     options.only_to_end
                         ? absl::StrCat("(attempts>=", options.max_attempts, " OR cancel<>0)")
                         : std::string("software_version=?"),
                     " ORDER BY calibration_number LIMIT 1", database.SkipLocked()));
    if (!options.only_to_end) row.Bind(1, std::string_view(holder.software_version));
    if (!row.Step()) return std::optional<ClaimedJob>();
    job.claim.calibration_number = row.Int64(0);
    attempts = static_cast<int>(row.Int64(1));
    job.cancel = row.Int64(2) != 0;
    job.claim.fence = row.Int64(3) + 1;
    last_holder = NameOf(HolderOf(row, 4));
  }
  const bool is_tried_enough = attempts >= options.max_attempts;
  if (!is_tried_enough && !job.cancel) ++attempts;
  Query(database,
        absl::StrCat("UPDATE calibration_job SET state=2, attempts=?, fence=?, holder_host=?, "
                     "holder_pid=?, holder_version=?, holder_is_server=?, lease_end_ms=",
                     LeaseEnd(database, lease_ms == 0 ? 0 : options.lease.count()),
                     ", stage=?, fraction_ppm=0, not_responding=0 WHERE calibration_number=?"),
        int64_t{attempts}, job.claim.fence, holder.host, holder.pid, holder.software_version,
        int64_t{holder.is_server}, CalibrationStage::kReading, job.claim.calibration_number)
      .Run();
  {
    SqlStatement row =
        Query(database, "SELECT id FROM calibration WHERE number=?", job.claim.calibration_number);
    if (row.Step()) job.claim.calibration_id = row.Text(0);
  }
  absl::StatusOr<Calibration> calibration = FindCalibration(database, job.claim.calibration_id);
  if (!calibration.ok()) {
    // It would be first in the queue for ever.
    job.damage = calibration.status();
    Query(database, "UPDATE calibration_job SET state=4 WHERE calibration_number=?",
          job.claim.calibration_number)
        .Run();
    return std::optional<ClaimedJob>(std::move(job));
  }
  if (is_tried_enough) {
    job.give_up =
        absl::StrCat("the process that solved it ended ", attempts, " times while it did, at last ",
                     last_holder, " (out of memory?); use fewer observations, or create it again");
  }
  job.calibration = *std::move(calibration);
  job.calibration.state = kRunning;
  job.calibration.start_utc_ns = options.utc_now_ns;
  job.calibration.attempt_count = static_cast<uint32_t>(attempts);
  job.calibration.software_version = holder.software_version;
  RIGCAL_RETURN_IF_ERROR(ReplaceCalibration(database, job.calibration));
  return std::optional<ClaimedJob>(std::move(job));
}

absl::StatusOr<bool> RenewJob(SqlDatabase& database, const JobClaim& claim,
                              const JobProgress& progress, int64_t lease_ms) {
  const int64_t renewed =
      Query(database,
            absl::StrCat("UPDATE calibration_job SET lease_end_ms=", LeaseEnd(database, lease_ms),
                         ", stage=?, fraction_ppm=?, not_responding=? "
                         "WHERE calibration_number=? AND state=2 AND fence=?"),
            progress.stage, Ppm(progress.fraction), int64_t{progress.not_responding},
            claim.calibration_number, claim.fence)
          .RunAndCount();
  if (renewed == 0) return LostClaim(database, claim);
  SqlStatement row =
      Query(database, "SELECT cancel FROM calibration_job WHERE calibration_number=?",
            claim.calibration_number);
  return row.Step() && row.Int64(0) != 0;
}

absl::Status FinishJob(SqlDatabase& database, const JobClaim& claim,
                       const Calibration& calibration) {
  const int64_t ended =
      Query(database,
            "UPDATE calibration_job SET state=?, attempts=?, "
            "lease_end_ms=0 WHERE calibration_number=? AND state=2 AND fence=?",
            calibration.state, calibration.attempt_count, claim.calibration_number, claim.fence)
          .RunAndCount();
  if (ended != 0) return ReplaceCalibration(database, calibration);
  // The same call, whose commit nobody answered.
  SqlStatement row =
      Query(database, "SELECT state, fence FROM calibration_job WHERE calibration_number=?",
            claim.calibration_number);
  if (row.Step() && row.Int64(1) == claim.fence &&
      row.Int64(0) == static_cast<int64_t>(calibration.state)) {
    return absl::OkStatus();
  }
  return LostClaim(database, claim);
}

absl::StatusOr<Calibration> CancelJob(SqlDatabase& database, std::string_view id, int64_t utc_ns) {
  Query(database,
        "UPDATE calibration_job SET cancel=1 WHERE state<=2 AND "
        "calibration_number IN (SELECT number FROM calibration WHERE id=?)",
        id)
      .Run();
  int64_t state = 0;
  {
    SqlStatement row = Query(database,
                             "SELECT j.state FROM calibration_job j JOIN calibration c "
                             "ON c.number=j.calibration_number WHERE c.id=?",
                             id);
    if (row.Step()) state = row.Int64(0);
  }
  RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, FindCalibration(database, id));
  if (state != static_cast<int64_t>(kQueued)) return calibration;
  calibration = Cancelled(std::move(calibration), utc_ns);
  RIGCAL_RETURN_IF_ERROR(ReplaceCalibration(database, calibration));
  return calibration;
}

absl::StatusOr<std::vector<CalibrationJob>> ListJobs(SqlDatabase& database, int64_t lease_ms) {
  SqlStatement row(
      database,
      absl::StrCat("SELECT c.id, j.state, j.attempts, j.cancel, CASE WHEN ",
                   LeaseIsOver(database, lease_ms),
                   " THEN 1 ELSE 0 END, j.software_version, j.stage, j.fraction_ppm, "
                   "j.not_responding, ",
                   kHolder,
                   ", j.calibration_number FROM calibration_job j JOIN calibration c ON "
                   "c.number=j.calibration_number WHERE j.state<=2 ORDER BY j.calibration_number"));
  SqlStatement session(database,
                       "SELECT session_id FROM calibration_session WHERE calibration_number=? "
                       "ORDER BY session_id");
  std::vector<CalibrationJob> jobs;
  while (row.Step()) {
    CalibrationJob job{.calibration_id = row.Text(0),
                       .session_ids = {},
                       .state = static_cast<CalibrationState>(row.Int64(1)),
                       .attempts = static_cast<int>(row.Int64(2)),
                       .cancel = row.Int64(3) != 0,
                       .software_version = row.Text(5),
                       .holder = HolderOf(row, 9),
                       .progress = {.stage = static_cast<CalibrationStage>(row.Int64(6)),
                                    .fraction = static_cast<double>(row.Int64(7)) / kPpm,
                                    .not_responding = row.Int64(8) != 0}};
    job.lease_is_over = job.state == kRunning && row.Int64(4) != 0;
    const StatementScope scope(session);
    BindAll(session, row.Int64(13));
    while (session.Step()) job.session_ids.push_back(session.Text(0));
    jobs.push_back(std::move(job));
  }
  return jobs;
}

void AdoptJobs(SqlDatabase& database, std::string_view software_version, bool all,
               int64_t lease_ms) {
  // Those whose record could not be read, once more.
  SqlStatement(database,
               "UPDATE calibration_job SET state=1, lease_end_ms=0 WHERE state>2 AND "
               "calibration_number IN (SELECT number FROM calibration WHERE state<=2)")
      .Run();
  Query(database,
        "UPDATE calibration_job SET state=1, lease_end_ms=0 WHERE state=2 AND "
        "(holder_is_server<>0 OR ?<>0)",
        int64_t{all})
      .Run();
  Query(database,
        absl::StrCat("UPDATE calibration_job SET software_version=?1 WHERE software_version<>?1 "
                     "AND (state=1 OR (state=2 AND ",
                     LeaseIsOver(database, lease_ms), "))"),
        software_version)
      .Run();
}

void NoteWorker(SqlDatabase& database, const JobHolder& holder) {
  const std::string now = database.NowMs();
  Query(database,
        absl::StrCat("INSERT INTO calibration_worker(host, pid, software_version, start_ms, "
                     "heartbeat_ms) VALUES(?,?,?,",
                     now, ",", now,
                     ") ON CONFLICT(host, pid) DO UPDATE SET "
                     "software_version=excluded.software_version, heartbeat_ms=",
                     now),
        holder.host, holder.pid, holder.software_version)
      .Run();
  SqlStatement(database, absl::StrCat("DELETE FROM calibration_worker WHERE heartbeat_ms<", now,
                                      "-", kWorkerKeptMs))
      .Run();
}

void ForgetWorker(SqlDatabase& database, const JobHolder& holder) {
  Query(database, "DELETE FROM calibration_worker WHERE host=? AND pid=?", holder.host, holder.pid)
      .Run();
}

std::vector<SolveWorker> ListWorkers(SqlDatabase& database) {
  SqlStatement row(database, absl::StrCat("SELECT host, pid, software_version, start_ms, "
                                          "heartbeat_ms, ",
                                          database.NowMs(),
                                          "-heartbeat_ms FROM calibration_worker "
                                          "ORDER BY host, pid"));
  SqlStatement job(database,
                   "SELECT c.id FROM calibration_job j JOIN calibration c ON "
                   "c.number=j.calibration_number WHERE j.state=2 AND j.holder_host=? AND "
                   "j.holder_pid=? ORDER BY c.number");
  std::vector<SolveWorker> workers;
  while (row.Step()) {
    SolveWorker worker{
        .holder = {.host = row.Text(0), .pid = row.Int64(1), .software_version = row.Text(2)},
        .start_utc_ns = row.Int64(3) * kNsPerMs,
        .heartbeat_utc_ns = row.Int64(4) * kNsPerMs,
        .is_alive = row.Int64(5) <= kJobLease.count(),
        .calibration_ids = {}};
    const StatementScope scope(job);
    BindAll(job, worker.holder.host, worker.holder.pid);
    while (job.Step()) worker.calibration_ids.push_back(job.Text(0));
    workers.push_back(std::move(worker));
  }
  return workers;
}

}  // namespace rigcal::server
