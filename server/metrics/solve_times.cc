// SPDX-License-Identifier: Apache-2.0
#include "server/metrics/solve_times.h"

#include <chrono>
#include <utility>

namespace rigcal::server {

SolveFunction SolveTimes::Measured(SolveFunction solve) {
  return [this, solve = std::move(solve)](const SolveTask& task, const CalibrationHooks& hooks) {
    const auto start = std::chrono::steady_clock::now();
    CalibrationOutcome outcome = solve(task, hooks);
    Add(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
        outcome.result.ok());
    return outcome;
  };
}

void SolveTimes::Add(double duration_s, bool succeeded) {
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < kLimitsS.size(); ++i) {
    if (duration_s <= kLimitsS[i]) ++counts_.within[i];
  }
  ++counts_.count;
  counts_.sum_s += duration_s;
  if (!succeeded) ++counts_.failed;
}

SolveTimes::Counts SolveTimes::Get() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace rigcal::server
