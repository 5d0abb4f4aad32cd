// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/camera/intrinsics.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::testing {

// A synthetic bundle adjustment: cameras in a ring around random wand poses. Its centres satisfy
// the residual of bundle_problem.h exactly, except for noise and outliers.
struct BundleSceneOptions {
  uint32_t seed = 1;
  int camera_count = 4;
  int instant_count = 40;
  std::vector<double> marker_positions_m = {0, 0.13, 0.39};
  std::vector<DistortionModel> models = {DistortionModel::kBrownConrady};  // assigned in turn
  std::vector<Eigen::Vector3d> points_m;                                   // of a rigid target
  int rigid_every = 0;  // instant that shows it instead of the wand; 0: none
  double noise_px = 0.3;
  double outlier_share = 0;  // of markers, moved anywhere in the image
  double hidden_share = 0;   // of observations
  double dropout_share = 0;  // of markers
  int clock_count = 0;       // cameras share them in turn; 0: one for each camera
  double offset_s = 0.004;   // one sigma of the true offsets
  double rate = 2e-5;        // one sigma of the true rates
  double initial_error = 1;  // 1: 0.01 rad, 2 cm for cameras; 3 cm, 0.05 rad for instants

  bool free_poses = true;
  bool free_offsets = true;
  bool free_rates = false;
  bool free_line_delays = false;  // each of some tens of microseconds; otherwise none has any
  bool free_intrinsics = false;
  bool free_spacing = false;
  bool free_points = false;  // under a prior of 1 mm
};

struct BundleScene {
  server::BundleProblem initial;
  server::BundleProblem ground_truth;
};

BundleScene MakeBundleScene(const BundleSceneOptions& options);

// Four cameras with all lens models, and a number of instants that is no multiple of eight.
BundleSceneOptions SmallBundleScene();

// Tolerances at which only rounding remains.
server::BundleOptions TightTolerances();

}  // namespace rigcal::testing
