// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace rigcal::wire {

// Ends absl's search for deadlocks, which Debian's build of absl makes at every lock, under one
// lock for all threads; gRPC takes some dozens of locks for a message. Locks held now stay usable.
// To be called once, at the start of a program.
void TakeLocksWithoutChecks();

}  // namespace rigcal::wire
