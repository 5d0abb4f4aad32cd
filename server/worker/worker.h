// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"

namespace rigcal::server {

// Exit code of a worker that needed more memory than it was allowed.
inline constexpr int kWorkerOutOfMemory = 12;

// Runs one solve: reads its input from `in`, and writes progress and outcome to `out`
// (rigcal/worker/v1/solve.proto). Reads and writes nothing else. A solve that fails is an outcome;
// errors are those of the two descriptors, and RESOURCE_EXHAUSTED where memory ran out.
absl::Status RunWorker(int in, int out);

// The same for one running estimate (rigcal/worker/v1/estimate.proto).
absl::Status RunEstimateWorker(int in, int out);

}  // namespace rigcal::server
