// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "common/camera/camera_description.h"
#include "common/session/observation_batch.h"
#include "common/target/observation.h"
#include "common/time/clock.h"

namespace rigcal::server {

// The observations of one camera in one session. Cameras are identified by name across sessions:
// the same name in two sessions is the same camera. `observations` may be in any order and may hold
// duplicates; consumers sort by (clock_epoch, time).
struct CameraTrack {
  std::string session_id;
  CameraDescription camera;               // intrinsics present
  std::vector<Observation> observations;  // empty ones included
  // For coarse alignment of clocks without a common time base, by clock epoch.
  struct EpochSample {
    uint32_t clock_epoch = 0;
    ClockSample sample;
  };
  std::vector<EpochSample> clock_samples;
  std::vector<HostAlignment> host_alignments;
};

// Adds every row of a batch of the track's camera, with the batch's clock samples and alignments.
void AddRows(const ObservationBatch& batch, CameraTrack* track);

}  // namespace rigcal::server
