// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/session/observation_batch.h"
#include "server/solve/running/running_estimate.h"

namespace rigcal::server {

// The rows of one estimate, by camera and session.
struct EstimateTask {
  Target target;
  std::vector<CameraTrack> tracks;                  // without rows
  std::vector<std::vector<ObservationBatch>> rows;  // by track
  double data_share = 1;
  EstimateStart start;
};

// Makes one running estimate. An error: it could not be tried.
using EstimateFunction = std::function<absl::StatusOr<RunningOutcome>(
    EstimateTask task, const std::atomic<bool>& cancelled)>;

// In this process, for tests.
EstimateFunction EstimateInProcess();

struct EstimateWorkerOptions {
  std::filesystem::path program;  // rigcal-worker
  uint64_t memory_bytes = uint64_t{2} << 30;
  std::chrono::milliseconds time_limit{30'000};
  // Without a sign of life.
  std::chrono::milliseconds silence_limit{15'000};
};

// In a process of its own for each estimate, at low priority and with limited memory. Errors:
// CANCELLED, DEADLINE_EXCEEDED (says whether it worked at all), RESOURCE_EXHAUSTED (its memory
// limit), UNAVAILABLE (killed), INTERNAL (crashed), and those of WorkerProcess::Start.
EstimateFunction EstimateInWorker(EstimateWorkerOptions options);

}  // namespace rigcal::server
