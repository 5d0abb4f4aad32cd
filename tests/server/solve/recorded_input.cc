// SPDX-License-Identifier: Apache-2.0
#include "tests/server/solve/recorded_input.h"

#include <utility>

#include "common/status/status_macros.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/recorded_tracks.h"

namespace rigcal::server {

absl::StatusOr<CalibrationInput> RecordedInput(const std::filesystem::path& data) {
  RIGCAL_ASSIGN_OR_RETURN(auto cameras, rigcal::testing::LoadRecordedTracks(data / "ewand"));
  CalibrationInput input;
  input.target = WandTarget();
  for (auto& camera : cameras) {
    CameraTrack track;
    track.session_id = "recorded";
    track.camera = std::move(camera.description);
    track.observations = std::move(camera.observations);
    input.tracks.push_back(std::move(track));
  }
  return input;
}

}  // namespace rigcal::server
