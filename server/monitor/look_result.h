// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"
#include "server/live/live_state.h"
#include "server/solve/evaluate/rig_difference.h"

namespace rigcal::server {

// How the clock of a camera has moved against the others between two looks.
struct ClockChange {
  double change_s = 0;  // beyond what its rate in the first look makes expect
  double sigma_s = 0;
  double ppm = 0;  // the change by the time between; 0: too short for that
  bool changed = false;
};

// By camera of both, where both have estimated its offset. A change of more than 6 sigma and 0.2 ms
// is none by chance.
std::map<std::string, ClockChange> CompareClocks(const CalibrationResult& first,
                                                 const CalibrationResult& now);

// Cameras that moved while the rows of a look were recorded, by the look's own findings.
std::set<std::string> MovedWithin(const CalibrationResult& look);

// Puts a look into the state: verdicts of its cameras, where there is one; of the others the last
// verdict stays. Where cameras moved within the look (`moved_within`) only these are said to have
// moved, because they drag the others along.
void TakeVerdicts(const RigDifference& difference, const std::set<std::string>& moved_within,
                  int64_t utc_ns, LiveMonitor* monitor);

}  // namespace rigcal::server
