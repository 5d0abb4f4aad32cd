// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/calibration/calibration_record.h"

namespace rigcal::server {

// How long the claim on a job lasts without a heartbeat, by the clock of the database. A worker
// that was killed costs so much time; one whose database or network is gone for less goes on
// undisturbed.
inline constexpr std::chrono::milliseconds kJobLease{10'000};

// A process that solves calibrations.
struct JobHolder {
  std::string host;
  int64_t pid = 0;
  std::string software_version;
  bool is_server = false;  // the server itself, not a rigcal-worker

  friend bool operator==(const JobHolder&, const JobHolder&) = default;
};

// For messages: "rigcal-worker on HOST (process PID)".
std::string NameOf(const JobHolder& holder);

// The right to end a job, until another process claims it: each claim of a job has a higher fencing
// number than the one before.
struct JobClaim {
  std::string calibration_id;
  int64_t calibration_number = 0;
  int64_t fence = 0;
};

struct ClaimOptions {
  // Claims of one job, after which it is only taken to be ended.
  int max_attempts = 3;
  // Takes only what is to be ended without a solve: cancelled, or tried too often.
  bool only_to_end = false;
  std::chrono::milliseconds lease = kJobLease;
  int64_t utc_now_ns = 0;  // becomes the start of the calibration
};

struct ClaimedJob {
  JobClaim claim;
  Calibration calibration;
  bool cancel = false;  // asked for before: to be ended as cancelled
  std::string give_up;  // not empty: it was tried too often; why
  absl::Status damage;  // the record cannot be read: the job is out of the queue until it is
                        // adopted again, and there is nothing to end
};

struct JobProgress {
  CalibrationStage stage = CalibrationStage::kUnspecified;
  double fraction = 0;  // of the stage, 0 to 1
  bool not_responding = false;

  friend bool operator==(const JobProgress&, const JobProgress&) = default;
};

// A calibration that has not ended.
struct CalibrationJob {
  std::string calibration_id;
  std::vector<std::string> session_ids;
  CalibrationState state = CalibrationState::kQueued;  // or kRunning
  int attempts = 0;
  bool cancel = false;
  bool lease_is_over = false;    // running, and nobody has heard of its holder
  std::string software_version;  // only this one may solve it
  JobHolder holder;              // while it runs
  JobProgress progress;
};

// A rigcal-worker that has reported within a day.
struct SolveWorker {
  JobHolder holder;
  int64_t start_utc_ns = 0;                  // of the database's clock, as the next one
  int64_t heartbeat_utc_ns = 0;              // the last one
  bool is_alive = false;                     // heard of within a lease
  std::vector<std::string> calibration_ids;  // what it solves
};

}  // namespace rigcal::server
