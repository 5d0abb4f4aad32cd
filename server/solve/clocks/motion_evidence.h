// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/associate/camera_track.h"
#include "server/associate/clock_steps.h"
#include "server/associate/static_points.h"
#include "server/solve/clocks/ray_paths.h"

namespace rigcal::server {

// Says at which of two times rows of a camera fit what the other cameras of their session saw: by
// the epipolar error of each of three cameras that share most with them, at both times and at
// others, which have to be clearly worse. The stamps of the others are taken as they are, but for a
// tenth of a second.
class MotionEvidence {
 public:
  // `tracks` must outlive it, and hold their rows until the first question about a session.
  MotionEvidence(const std::vector<CameraTrack>& tracks, TargetOfSession target_of);

  // See StepEvidence.
  std::optional<bool> operator()(const StepQuestion& question);

 private:
  // Of the cameras of a session, by name; of markers that move.
  using PathsOfSession = std::map<std::string, TrackPaths>;
  struct Session {
    int64_t origin_ns = 0;
    PathsOfSession paths;
  };
  const Session& SessionOf(const std::string& session_id);

  const std::vector<CameraTrack>& tracks_;
  TargetOfSession target_of_;
  std::map<std::string, Session> sessions_;
};

}  // namespace rigcal::server
