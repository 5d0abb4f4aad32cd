// SPDX-License-Identifier: Apache-2.0
#include "tests/server/solve/recorded_input.h"

#include <utility>

#include "common/status/status_macros.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/recorded_tracks.h"

namespace rigcal::server {

namespace {

absl::StatusOr<CalibrationInput> Load(const std::filesystem::path& folder, Target target) {
  RIGCAL_ASSIGN_OR_RETURN(auto cameras, rigcal::testing::LoadRecordedTracks(folder));
  CalibrationInput input;
  input.target = std::move(target);
  for (auto& camera : cameras) {
    CameraTrack track;
    track.session_id = "recorded";
    track.camera = std::move(camera.description);
    track.observations = std::move(camera.observations);
    input.tracks.push_back(std::move(track));
  }
  return input;
}

}  // namespace

absl::StatusOr<CalibrationInput> RecordedInput(const std::filesystem::path& data) {
  return Load(data / "ewand", WandTarget());
}

absl::StatusOr<CalibrationInput> RecordedFlight(const std::filesystem::path& data) {
  Target point;
  point.kind = TargetKind::kPoint;
  point.marker_positions_m = {0};
  return Load(data / "flight", std::move(point));
}

}  // namespace rigcal::server
