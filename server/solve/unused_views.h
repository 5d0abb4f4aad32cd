// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/status/refusal.h"
#include "server/associate/straight_clocks.h"
#include "server/solve/input_checks.h"

namespace rigcal::server {

// Shares of a camera's wand views that a good and a usable calibration may leave unused.
inline constexpr double kGoodWithoutViews = 0.1, kUsableWithoutViews = 0.4;

// Of one camera.
struct UnusedViews {
  std::string camera;
  uint64_t lost = 0, all = 0;
  const Refusal* most = nullptr;  // the reason that cost most; into the list that was given
};
std::vector<UnusedViews> CountUnusedViews(const std::map<std::string, CameraCounts>& counts,
                                          const std::vector<Refusal>& refused);

// Adds `views_not_used` for each camera of the result of whose wand views more than a tenth are not
// used, with the reason that cost most. Not counted are rows that are delivered twice, and rows
// that are near an instant in which the camera has a nearer one. `counts`: of the input.
void NoteUnusedViews(const std::map<std::string, CameraCounts>& counts,
                     const std::vector<Refusal>& refused, CalibrationResult* result);

// As findings, without a severity.
std::vector<Finding> FindingsOf(const std::vector<StampFault>& faults);

}  // namespace rigcal::server
