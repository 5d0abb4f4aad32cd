// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/evaluate/evaluated_solve.h"

namespace rigcal::server {

// Offsets (seconds) and rates (s/s) of the clocks against the median clock of their session, by
// clock of the index.
struct ClockReport {
  std::vector<double> offset_s, rate;
  std::vector<double> offset_sigma_s, rate_sigma;  // one sigma; zeros without an uncertainty
};

ClockReport ReportClocks(const RigObservations& rig, const EvaluatedSolution& evaluated);

}  // namespace rigcal::server
