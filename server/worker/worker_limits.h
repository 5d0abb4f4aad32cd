// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>

#include "absl/status/status.h"

namespace rigcal::server {

// What a solve of a three-marker wand needs at its peak, measured with six cameras, and a worker
// before it has read anything. docs/performance.md has the figures.
inline constexpr uint64_t kSolveBaseBytes = uint64_t{128} << 20;
inline constexpr uint64_t kSolveBytesPerRow = 180;
inline constexpr uint64_t kSolveBytesPerMarker = 140;

// The general path's memory of a marker of a rigid target, in those of the kernel: a residual block
// of Ceres with its Jacobian.
inline constexpr uint64_t kGeneralPathFactor = 8;

// Memory that a solve of so many rows is allowed: one and a half times what it is known to need.
inline constexpr uint64_t SolveMemoryBytes(uint64_t rows, uint64_t markers_per_row) {
  const uint64_t per_row = kSolveBytesPerRow + kSolveBytesPerMarker * markers_per_row;
  return kSolveBaseBytes + rows * per_row * 3 / 2;
}

// Makes this process a worker: lowest claim on the CPU, first choice when the system's memory runs
// out, ended with `parent`, no descriptors but the standard ones, and at most `memory_bytes` more
// memory than it has now (0: no limit). `parent` 0: runs on its own.
// FAILED_PRECONDITION: the parent has gone, or the system refuses.
absl::Status ApplyWorkerLimits(pid_t parent, uint64_t memory_bytes);

}  // namespace rigcal::server
