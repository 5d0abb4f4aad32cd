// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <mutex>

#include "server/session/calibration_solver.h"

namespace rigcal::server {

// How long the solves of this server took. Thread-safe.
class SolveTimes {
 public:
  // Upper limits of the counts, seconds.
  static constexpr std::array<double, 10> kLimitsS = {1, 2, 5, 10, 20, 60, 120, 300, 900, 3600};

  struct Counts {
    std::array<uint64_t, kLimitsS.size()> within{};  // each limit: cumulative
    uint64_t count = 0;
    double sum_s = 0;
    uint64_t failed = 0;
  };

  // The same solves, measured by this object, which outlives them.
  SolveFunction Measured(SolveFunction solve);
  void Add(double duration_s, bool succeeded);
  Counts Get() const;

 private:
  mutable std::mutex mutex_;
  Counts counts_;
};

}  // namespace rigcal::server
