// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/status/refusal.h"
#include "common/target/observation.h"
#include "server/associate/stamp_fault.h"

namespace rigcal::server {

struct StampStream;

// Rows of one camera in a session, in their order. Do they belong to their stamps plus `moved_ns`,
// and not plus `stay_ns`?
struct StepQuestion {
  std::string session_id, camera;
  std::vector<const Observation*> rows;
  int64_t stay_ns = 0, moved_ns = 0;
};
// What the motion says that the other cameras of the session saw; none: it does not say. Empty:
// nobody is asked.
using StepEvidence = std::function<std::optional<bool>(const StepQuestion&)>;

// Finds where the clocks of one session's cameras were set, and moves the rows of each side onto
// one time scale (straight_clocks.h).
void StraightenSession(const std::vector<StampStream*>& streams, const StepEvidence& evidence,
                       RefusalCounter* refused, std::vector<StampFault>* faults);

}  // namespace rigcal::server
