// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paired_start.h"

#include "absl/strings/str_cat.h"
#include "common/camera/intrinsics_vector.h"
#include "common/status/status_macros.h"
#include "server/solve/initialize/initialization.h"

namespace rigcal::accuracy {
namespace {

using server::BundleInstant;
using server::BundleMarker;
using server::BundleObservation;
using server::BundleProblem;

void AddInstant(const PairedRows& rows, bool is_rigid, BundleProblem* problem) {
  BundleInstant& instant = problem->instants.emplace_back();
  instant.is_rigid = is_rigid;
  instant.first_observation = static_cast<int>(problem->observations.size());
  instant.observation_count = static_cast<int>(rows.size());
  for (const auto& [camera, row] : rows) {
    BundleObservation& observation = problem->observations.emplace_back();
    observation.camera = observation.clock = camera;
    observation.first_marker = static_cast<int>(problem->markers.size());
    for (size_t m = 0; m < row->markers.size(); ++m) {
      if (!row->markers[m].visible) continue;
      BundleMarker& marker = problem->markers.emplace_back();
      marker.centre_px = row->markers[m].centre_px;
      marker.marker = static_cast<int>(m);
      ++observation.marker_count;
    }
  }
}

}  // namespace

absl::StatusOr<BundleProblem> StartFromPairs(const server::CalibrationInput& input,
                                             const std::vector<PairedRows>& instants) {
  BundleProblem problem;
  problem.target.marker_positions_m = input.target.marker_positions_m;
  for (const TargetPoint& point : input.target.points) {
    problem.rigid_target.points_m.emplace_back(point.x_m, point.y_m, point.z_m);
  }
  for (const server::CameraTrack& track : input.tracks) {
    if (!track.camera.intrinsics) {
      return absl::InvalidArgumentError(
          absl::StrCat("camera ", track.camera.camera, " has no intrinsics; give its lens"));
    }
    server::BundleCamera& camera = problem.cameras.emplace_back();
    camera.name = track.camera.camera;
    camera.pose_fixed = problem.cameras.size() == 1;
    camera.model = track.camera.intrinsics->model;
    camera.intrinsics = ToVector(*track.camera.intrinsics);
    problem.clocks.emplace_back().clock_id = track.camera.clock.clock_id;
  }
  for (const PairedRows& rows : instants) AddInstant(rows, !input.target.IsLine(), &problem);
  RIGCAL_RETURN_IF_ERROR(server::FindInitialization({}, &problem));
  // What disagreed with the start is part of the solve.
  for (BundleMarker& marker : problem.markers) marker.used = true;
  return problem;
}

CalibrationResult ResultOf(const server::CalibrationInput& input, const BundleProblem& problem) {
  CalibrationResult result;
  result.scale_known = true;
  result.reference_camera = input.tracks.front().camera.camera;
  result.target.given = input.target;
  result.target.marker_positions_m = input.target.marker_positions_m;
  for (size_t c = 0; c < input.tracks.size(); ++c) {
    const CameraDescription& given = input.tracks[c].camera;
    CalibratedCamera& camera = result.cameras.emplace_back();
    camera.camera = given.camera;
    camera.image_size_px = given.image_size_px;
    camera.intrinsics = *given.intrinsics;
    camera.clock_id = given.clock.clock_id;
    camera.cam_from_rig = problem.cameras[c].cam_from_rig;
  }
  return result;
}

}  // namespace rigcal::accuracy
