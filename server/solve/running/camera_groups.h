// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/associate/align_clocks.h"
#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

// Two cameras that have seen too little together.
struct PairNeed {
  std::string camera_a, camera_b;
  int common_count = 0;
  int needed_count = 0;
};

// Cameras in groups that are connected by pairs with at least 40 common instants.
struct CameraGroups {
  std::vector<int> group_of_camera;
  int largest = 0;              // the group with most cameras
  std::vector<PairNeed> needs;  // what would connect the groups with the least waving
};

// `rig_times` as of RigTimes. Of at least one camera.
CameraGroups GroupCameras(const RigIndex& index, const std::vector<AlignedTrack>& tracks,
                          const std::vector<std::vector<int64_t>>& rig_times);

}  // namespace rigcal::server
