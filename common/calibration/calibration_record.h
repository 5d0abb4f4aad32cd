// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/calibration/calibration_stage.h"

namespace rigcal {

enum class CalibrationState : uint8_t {
  kQueued = 1,
  kRunning = 2,
  kSucceeded = 3,
  kFailed = 4,
  kCancelled = 5,  // by an operator
};

// No process works on it, and its record stays as it is.
constexpr bool HasEnded(CalibrationState state) { return state >= CalibrationState::kSucceeded; }

// The state of one that has no result yet, or never will: "it failed".
constexpr const char* WhyNoResult(CalibrationState state) {
  if (state == CalibrationState::kCancelled) return "it was cancelled";
  return state == CalibrationState::kFailed ? "it failed" : "it has not ended yet";
}

// A calibration as a resource: versioned, and immutable once it has ended.
struct Calibration {
  std::string id;
  std::string rig;
  uint32_t version = 0;  // counts up within the rig
  std::vector<std::string> session_ids;
  CalibrationState state = CalibrationState::kQueued;
  std::string error;  // why it failed, and what to do; "cancelled"
  CalibrationStage progress_stage = CalibrationStage::kUnspecified;
  double progress_fraction = 0;
  bool not_responding = false;  // the process that solves; see CalibrationProgress in the protocol
  std::string solved_by = {};   // while it runs elsewhere: the process; not stored
  std::string waiting = {};     // why nobody solves it; not stored
  CalibrationOptions options;
  std::optional<CalibrationResult> result;  // once succeeded
  std::vector<Refusal> refused;             // when it failed: what had been left out by then

  int64_t create_utc_ns = 0;
  int64_t start_utc_ns = 0;  // 0: has not happened
  int64_t end_utc_ns = 0;
  double duration_s = 0;
  std::string software_version;
  std::string operator_name;      // who asked for it; empty: the server's own PC
  std::string reason, notes;      // as given
  std::vector<std::string> held;  // what was not estimated: "pose of cam1"; empty: a full solve
  uint32_t attempt_count = 0;     // how often it was begun; not shown to clients
  std::string damage = {};        // in lists: why the stored record cannot be read; not stored
};

}  // namespace rigcal
