// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// Places in the programs where a test can end or delay them: the fault tests kill an agent or a
// server exactly there. Without RIGCAL_FAILPOINT in the environment a failpoint costs one load.
namespace rigcal {

inline constexpr std::string_view kFailpointNames[] = {
    "after_spool_append",  // agent: an observation is in its segment, not synced
    "after_send",          // agent: a message was handed to gRPC
    "segment_rotation",    // agent: a new segment exists, and nothing is in it
    "checkpoint_rename",   // agent: the new checkpoint is synced under its temporary name
    "before_commit",       // server: a group of deliveries is about to be stored
    "after_commit",        // server: it is durable, and nobody knows
    "before_ack",          // server: an acknowledgement is about to be handed to its stream
    "after_ack",           // server: all acknowledgements of a commit were handed over
};

struct FailpointAction {
  std::string name;
  bool abort = false;
  std::chrono::milliseconds sleep{0};  // unless abort
  uint64_t pass = 1;                   // abort at this pass; sleep from this pass on
};

// `name:abort` or `name:sleep_MS`, with `@N` behind it for the N-th pass; several with commas.
// INVALID_ARGUMENT: what is wrong with which part.
absl::StatusOr<std::vector<FailpointAction>> ParseFailpoints(std::string_view text);

// Activates what RIGCAL_FAILPOINT says. Once, before threads. Errors as ParseFailpoints: a program
// with a failpoint that it does not understand must not run.
absl::Status ActivateFailpoints();

namespace failpoint_internal {
extern std::atomic<bool> active;
void Pass(std::string_view name);
}  // namespace failpoint_internal

// `name` is one of kFailpointNames.
inline void Failpoint(std::string_view name) {
  if (failpoint_internal::active.load(std::memory_order_relaxed)) failpoint_internal::Pass(name);
}

}  // namespace rigcal
