// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "common/calibration/calibration.h"
#include "server/solve/clocks/time_search.h"
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

// What the search of times has to say about a solve that came of it: clocks found by motion alone,
// and motion that repeats itself.
void AddSearchFindings(const RigObservations& rig, const TimeSearchOutcome& searched,
                       std::vector<Finding>* findings);

// FAILED_PRECONDITION: a clock may be one of several, and is none of them.
absl::Status CheckDecided(const RigObservations& rig, const TimeSearchOutcome& searched);

// A rig that cannot be solved may be so because its clocks were matched a period off.
absl::Status WithPeriod(const absl::Status& failed, double period_s);

}  // namespace rigcal::server
