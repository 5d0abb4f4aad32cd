// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/camera/camera_description.h"
#include "common/status/refusal.h"
#include "server/associate/camera_track.h"
#include "server/associate/observation_table.h"

namespace rigcal::server {

// One camera in one session and one epoch of its clock: usable observations, ascending in time, no
// two at one time, empty ones included.
struct CleanTrack {
  std::string session_id;
  CameraDescription camera;
  uint32_t clock_epoch = 0;
  ObservationTable observations;
};

// Whether two observations show the same, in every value of every visible marker.
bool SameValues(const Observation& a, const Observation& b);

// Sorts observations and rejects unusable ones. The result depends on the
// set of observations only: tracks come sorted by (session, camera, clock epoch), and several
// CameraTracks of one session and camera are taken together. Two observations of one camera, epoch
// and time: equal in every value, one is kept and the others are counted as `duplicate_equal`;
// else all are rejected as `duplicate_conflict`. Also rejected and counted: `value_not_finite`,
// `covariance_not_positive`, `marker_count_mismatch`. The rows of `tracks` are freed as soon as
// they have been read.
std::vector<CleanTrack> CleanTracks(std::vector<CameraTrack>* tracks, int marker_count,
                                    RefusalCounter* refused);
// With a target of its own for each session.
using MarkerCountOfSession = std::function<int(const std::string& session_id)>;
std::vector<CleanTrack> CleanTracks(std::vector<CameraTrack>* tracks,
                                    const MarkerCountOfSession& marker_count_of,
                                    RefusalCounter* refused);

}  // namespace rigcal::server
