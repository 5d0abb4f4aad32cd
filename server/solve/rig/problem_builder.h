// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "server/associate/align_clocks.h"
#include "server/associate/instants.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/rig/image_motion.h"
#include "server/solve/rig/target_parts.h"

namespace rigcal::server {

// Correction of one clock of one session, on top of the coarse alignment of its tracks:
//   rig_time = coarse rig time + time_offset_s + time_rate * (camera_time - time_epoch)
struct ClockCorrection {
  std::string session_id;
  std::string clock_id;
  uint32_t clock_epoch = 0;
  int64_t time_epoch_ns = 0;  // camera time; the first row of any of its cameras
  double time_offset_s = 0;
  double time_rate = 0;

  double At(int64_t camera_time_ns) const {
    return time_offset_s + time_rate * 1e-9 * static_cast<double>(camera_time_ns - time_epoch_ns);
  }
};

// Indices of clocks by session.
std::map<std::string, std::vector<size_t>> ClocksBySession(
    const std::vector<ClockCorrection>& clocks);

// The cameras and clocks behind the tracks, by index.
struct RigIndex {
  std::vector<CameraDescription> cameras;  // ascending by name
  std::vector<int> camera_of_track;
  std::vector<int> clock_of_track;
};

// Cameras come ascending by name, clocks in the order of the tracks; corrections are zero. Each
// session of static points has one made-up clock for all its tracks.
RigIndex IndexRig(const std::vector<AlignedTrack>& tracks, std::vector<ClockCorrection>* clocks);

// Rig times of every row under the corrections; with `motions`, by track, those at which its
// markers were seen in the mean, by their line delays.
std::vector<std::vector<int64_t>> RigTimes(const std::vector<AlignedTrack>& tracks,
                                           const RigIndex& index,
                                           const std::vector<ClockCorrection>& clocks,
                                           const std::vector<ImageMotion>* motions = nullptr);

// Origin of a marker of the problem.
struct MarkerSource {
  int track = 0;
  int observation = 0;
  // Variance of the centre by the one the problem states for it: MarkerMotion::noise_share.
  double noise_share = 1;
};

struct BuiltProblem {
  BundleProblem problem;
  std::vector<MarkerSource> sources;     // by marker of the problem
  std::vector<int64_t> instant_time_ns;  // rig time, by instant
};

// L with L^T L = S^-1.
Eigen::Matrix2d SqrtInformation(const Eigen::Matrix2d& covariance);

// The bundle adjustment of these instants: every visible marker moved to its instant's time along
// its image motion, which knows the line delays, with the label that the motion gives it. Cameras
// have their given intrinsics and no pose; clocks are fixed, as are intrinsics and target.
// `sigma_px` > 0 replaces the observed covariances.
BuiltProblem BuildProblem(const TargetParts& targets, const std::vector<AlignedTrack>& tracks,
                          const std::vector<ImageMotion>& motions, const RigIndex& index,
                          const std::vector<ClockCorrection>& clocks,
                          const std::vector<Instant>& instants, double sigma_px);

}  // namespace rigcal::server
