// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "absl/status/statusor.h"
#include "server/jobs/signs_of_life.h"
#include "server/session/calibration_solver.h"

namespace rigcal::server {

struct WorkerOptions {
  std::filesystem::path program;  // rigcal-worker
  // For the observations of one solve, about as large as they are in the store. The file has no
  // name, so nothing is left of it whatever happens.
  std::filesystem::path scratch_dir;
  // At most; a solve of few observations is allowed less (SolveMemoryBytes).
  uint64_t max_memory_bytes = uint64_t{12} << 30;
  SilenceLimits silence = {};
};

// Solves in a process of its own, one for each solve, at low priority and with limited memory.
// Gives the same result as SolveInProcess, bit for bit. What happens to the process is an outcome
// in plain words: RESOURCE_EXHAUSTED (its memory limit), UNAVAILABLE (killed from outside),
// INTERNAL (crashed), DEADLINE_EXCEEDED (it is stopped or hangs), CANCELLED.
SolveFunction SolveInWorker(WorkerOptions options);

// rigcal-worker in the folder of the running program.
absl::StatusOr<std::filesystem::path> FindWorker();

}  // namespace rigcal::server
