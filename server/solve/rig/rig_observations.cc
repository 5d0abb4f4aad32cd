// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

std::vector<ImageMotion> MotionsOf(const RigObservations& rig) {
  std::vector<ImageMotion> motions;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    motions.emplace_back(rig.tracks[t], rig.TargetOf(t).marker_count());
  }
  return motions;
}

}  // namespace rigcal::server
