// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "common/geometry/rigid_transform.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_solution.h"

namespace rigcal::server {

// Where a solve that left out some of the data put the cameras.
struct FoldPoses {
  std::vector<RigidTransform> cam_from_rig;
  double left_out = 0;  // share of the instants
};

FoldPoses FoldPosesOf(const RigSolution& fold, int all_instants);

// Least data for which the prediction holds.
inline constexpr int kMinPredictedInstants = 60;
inline constexpr int kMinPredictedBlocks = 4;

// How far the camera positions are expected to be off, and what would be accepted. Lengths are in
// the unit of the solution.
struct PredictedError {
  // One sigma of the camera position known worst, after the best rigid motion of the whole rig
  // (FrameFreeCentreSigmas): the frame is that of the reference camera, whose own pose may be known
  // ten times worse than the rig's shape. The scale apart, which is as good as the wand was
  // measured. The largest of the following; infinite where the data leave something undetermined.
  double sigma_m = 0;
  double stated_m = 0;         // by the covariance
  double by_folds_m = 0;       // by the folds; 0: too few of them
  double by_intrinsics_m = 0;  // between given and refined intrinsics, where the choice was close
  double accepted_m = 0;
  double distance_m = 0;  // of the cameras from the middle of the waved volume, median
  int instant_count = 0;
  int block_count = 0;  // blocks of time in which the target was placed a few times
  int fold_count = 0;   // parts of the data that could be solved by themselves
  // False: residuals over so little time say nothing about what they have in common, such as the
  // same part of each image, and neither sigma holds.
  bool holds = false;
};

// The delete-a-group jackknife (Shao and Wu 1989) takes the scatter of the folds as it is, errors
// common to neighbouring instants included, which the covariance counts as independent.
// `accept_m`: CalibrationOptions::accept_m. `refined`: the same data solved with refined
// intrinsics, where they were kept for want of a better reason; else null.
PredictedError PredictError(const RigSolution& solution,
                            const std::optional<RigUncertainty>& uncertainty,
                            const std::vector<FoldPoses>& folds, const FoldPoses* refined,
                            double accept_m);

}  // namespace rigcal::server
