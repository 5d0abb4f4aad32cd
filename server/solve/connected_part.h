// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/solve_and_report.h"

namespace rigcal::server {

// Of a rig whose cameras are not connected, the group that can be calibrated without the others.
struct ConnectedPart {
  std::string reference_camera;       // that of the options, if it is one of them
  std::vector<std::string> left_out;  // cameras
  std::vector<Finding> findings;      // weak_link, one for each of those, with what to do
};

// The largest group of three cameras or more, of equal ones that with the reference camera; that
// with the reference camera where it was `asked_reference` for. None where `failed` says nothing of
// groups, where no group is large enough (two cameras alone cannot be judged by a third), or where
// the options name cameras of another one.
std::optional<ConnectedPart> FindConnectedPart(const absl::Status& failed, const RigIndex& index,
                                               const CalibrationOptions& options,
                                               bool asked_reference);

// The rig without these cameras; their clocks go, too.
RigObservations WithoutCameras(const RigObservations& rig, const std::vector<std::string>& cameras,
                               std::vector<ClockCorrection>* clocks);

}  // namespace rigcal::server
