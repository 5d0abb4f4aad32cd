// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "common/calibration/calibration_options.h"
#include "server/solve/calibrate.h"
#include "server/store/store.h"

namespace rigcal::server {

// One calibration to solve. What it refers to outlives the solve.
struct SolveTask {
  const Store& store;
  const std::vector<std::string>& session_ids;
  size_t max_observations = 0;
  const CalibrationOptions& options;
  const Calibration* parent = nullptr;  // of the options; null: none
};

// Reads the observations of the sessions from the store and solves. `hooks.cancelled` is set.
using SolveFunction = std::function<CalibrationOutcome(const SolveTask&, const CalibrationHooks&)>;

// server/solve's Calibrate, or a test's.
using CalibrateFunction = std::function<CalibrationOutcome(
    const CalibrationInput&, const CalibrationOptions&, const CalibrationHooks&)>;

// Solves in this process, with all observations in memory.
SolveFunction SolveInProcess(CalibrateFunction calibrate);

// The outcome where the observations cannot be read.
CalibrationOutcome CannotRead(const absl::Status& status, const RefusalCounter& refused);

}  // namespace rigcal::server
