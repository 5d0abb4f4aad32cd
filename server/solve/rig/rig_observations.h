// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "common/target/target.h"
#include "server/associate/align_clocks.h"
#include "server/solve/rig/image_motion.h"
#include "server/solve/rig/problem_builder.h"
#include "server/solve/rig/target_parts.h"

namespace rigcal::server {

// What is solved: cameras, clocks and their rows.
struct RigObservations {
  Target target;                                // of the sessions that other_targets does not name
  std::map<std::string, Target> other_targets;  // by session
  std::vector<AlignedTrack> tracks;
  RigIndex index;

  const Target& TargetOf(const std::string& session_id) const {
    const auto found = other_targets.find(session_id);
    return found == other_targets.end() ? target : found->second;
  }
  const Target& TargetOf(size_t track) const { return TargetOf(tracks[track].track.session_id); }
  TargetParts Parts() const { return {target, other_targets}; }
};

// By track, outlying centres excluded.
std::vector<ImageMotion> MotionsOf(const RigObservations& rig);

}  // namespace rigcal::server
