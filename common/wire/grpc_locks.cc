// SPDX-License-Identifier: Apache-2.0
#include "common/wire/grpc_locks.h"

#include "absl/synchronization/mutex.h"

namespace rigcal::wire {

void TakeLocksWithoutChecks() {
  absl::SetMutexDeadlockDetectionMode(absl::OnDeadlockCycle::kIgnore);
}

}  // namespace rigcal::wire
