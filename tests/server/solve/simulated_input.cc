// SPDX-License-Identifier: Apache-2.0
#include "tests/server/solve/simulated_input.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/associate/static_points.h"

namespace rigcal::server {

CalibrationInput InputOf(const SimulatedWorld& world,
                         std::vector<std::vector<std::vector<bool>>>* outliers) {
  CalibrationInput input;
  input.target = world.target();
  for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
    CameraTrack track;
    track.session_id = "s";
    track.camera = world.cameras()[static_cast<size_t>(c)].description;
    if (outliers != nullptr) outliers->emplace_back();
    for (int i = 0; i < world.FrameCount(c); ++i) {
      std::vector<bool> is_outlier;
      track.observations.push_back(world.Observe(c, i, &is_outlier));
      if (outliers != nullptr) outliers->back().push_back(is_outlier);
      if (world.options().clock_samples && i % 25 == 0) {
        track.clock_samples.push_back(
            {track.observations.back().clock_epoch, world.SampleClock(c, i)});
      }
    }
    input.tracks.push_back(std::move(track));
  }
  return input;
}

CalibrationInput MixedInputOf(const std::vector<SimulatedWorld>& worlds) {
  CalibrationInput mixed;
  for (size_t w = 0; w < worlds.size(); ++w) {
    CalibrationInput input = InputOf(worlds[w]);
    const std::string session = absl::StrCat("s", w);
    if (w == 0) mixed.target = input.target;
    if (w > 0) mixed.other_targets[session] = input.target;
    for (CameraTrack& track : input.tracks) {
      const size_t count = track.observations.size();
      std::vector<Observation> own(
          track.observations.begin() + static_cast<std::ptrdiff_t>(w * count / worlds.size()),
          track.observations.begin() +
              static_cast<std::ptrdiff_t>((w + 1) * count / worlds.size()));
      track.observations = std::move(own);
      track.session_id = session;
      mixed.tracks.push_back(std::move(track));
    }
  }
  return mixed;
}

RigObservations RigOf(const CalibrationInput& input, std::vector<ClockCorrection>* clocks) {
  RefusalCounter refused;
  RigObservations rig;
  rig.target = input.target;
  rig.other_targets = input.other_targets;
  std::vector<CameraTrack> rows = input.tracks;
  const auto target_of = [&rig](const std::string& session_id) -> const Target& {
    return rig.TargetOf(session_id);
  };
  rig.tracks = AlignTracks(&rows, target_of, &refused, nullptr);
  rig.index = IndexRig(rig.tracks, clocks);
  return rig;
}

PoseErrors ComparePoses(const CalibrationResult& result, const SimulatedWorld& world) {
  const auto count = static_cast<Eigen::Index>(result.cameras.size());
  Eigen::Matrix3Xd solved(3, count), truth(3, count);
  Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
  std::vector<const SimulatedCamera*> cameras;
  for (Eigen::Index c = 0; c < count; ++c) {
    const CalibratedCamera& camera = result.cameras[static_cast<size_t>(c)];
    const auto found = std::find_if(
        world.cameras().begin(), world.cameras().end(),
        [&](const SimulatedCamera& entry) { return entry.description.camera == camera.camera; });
    cameras.push_back(&*found);
    solved.col(c) = camera.cam_from_rig.SourceFromTargetTranslation();
    truth.col(c) = found->cam_from_rig.SourceFromTargetTranslation();
    turn += (found->cam_from_rig.rotation.conjugate() * camera.cam_from_rig.rotation)
                .toRotationMatrix();
  }
  const Eigen::Vector3d solved_mean = solved.rowwise().mean(), truth_mean = truth.rowwise().mean();
  if (count > 2) {
    turn = Eigen::umeyama(solved, truth, false).topLeftCorner<3, 3>();
  } else {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(turn, Eigen::ComputeFullU | Eigen::ComputeFullV);
    turn = svd.matrixU() * svd.matrixV().transpose();
  }
  PoseErrors errors;
  double squares = 0;
  for (Eigen::Index c = 0; c < count; ++c) {
    const Eigen::Vector3d error =
        turn * (solved.col(c) - solved_mean) - (truth.col(c) - truth_mean);
    errors.worst_position_m = std::max(errors.worst_position_m, error.norm());
    squares += error.squaredNorm();
    const Eigen::Quaterniond rotation =
        result.cameras[static_cast<size_t>(c)].cam_from_rig.rotation *
        Eigen::Quaterniond(turn).conjugate() *
        cameras[static_cast<size_t>(c)]->cam_from_rig.rotation.conjugate();
    errors.worst_rotation_rad =
        std::max(errors.worst_rotation_rad, Eigen::AngleAxisd(rotation).angle());
  }
  errors.rms_position_m = std::sqrt(squares / static_cast<double>(count));
  return errors;
}

}  // namespace rigcal::server
