// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/geometry/rigid_transform.h"
#include "common/simulation/world/simulated_world.h"
#include "server/solve/calibrate.h"

namespace rigcal::accuracy {

// A recording with what a perfect calibration of it would give.
struct DoctorPatient {
  server::CalibrationInput input;
  std::string camera;        // the one to disturb
  std::string other_camera;  // the second one, where two are
  // The true poses, in the frame of the camera with the lowest name.
  std::map<std::string, RigidTransform> cam_from_rig;
  std::set<std::string> known;  // "kind:camera" of what is found without a disturbance, and true
  // What was simulated; null: a recording.
  std::shared_ptr<const SimulatedWorld> world;
  double distance_m = 0;  // of the cameras from the middle of the waved volume, median
};

// The track of the camera to disturb.
server::CameraTrack& TrackOf(DoctorPatient* patient);

// First stamp and length, in seconds, of some rows.
std::pair<int64_t, double> SpanOf(const std::vector<Observation>& rows);

// `change` gets the share of the recording that has passed, and a marker that is seen.
void ForEachCentre(server::CameraTrack* track,
                   const std::function<void(double share, MarkerObservation*)>& change);

// A simulated rig of seed `seed`; INTERNAL or INVALID_ARGUMENT from the simulation.
absl::StatusOr<DoctorPatient> SimulatedPatient(uint32_t seed, int camera_count, double duration_s);
// The real recording; its ground truth is its own calibration. Errors of reading it, and of that.
absl::StatusOr<DoctorPatient> RecordedPatient();

}  // namespace rigcal::accuracy
