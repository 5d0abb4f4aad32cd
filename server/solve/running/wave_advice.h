// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/camera/camera_description.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/running/expected_error.h"

namespace rigcal::server {

struct WaveAdvice {
  std::string text;                  // "low, between frame_1 and frame_3, wand upright"
  Eigen::Vector3d point_m;           // frame rig
  Eigen::Vector3d direction;         // of the wand, unit
  std::vector<std::string> cameras;  // that see all of it there
  double expected_p95_m = 0;         // ExpectedError::p95_m after waving there
};

struct WaveAdviceOptions {
  int instants = 100;     // that waving at one place is thought to add
  size_t max_advice = 3;  // places
};

// Where waving the target would reduce the expected error most, best first: for places of the grid
// that are waved or next to such and that two cameras see, and three directions of the target, the
// information of `instants` more instants is added to what there is, and the error over the grid
// computed anew. Places that gain less than a twentieth are left out, and one neighbourhood is
// named once. `data_share`: the share of all instants that the solution was made from.
std::vector<WaveAdvice> AdviseWaving(const RigSolution& solution, const RigUncertainty& uncertainty,
                                     const std::vector<CameraDescription>& cameras,
                                     const WavedGrid& grid, const PointGains& gains,
                                     const ExpectedError& error, double sigma_px, double data_share,
                                     const WaveAdviceOptions& options);

// The place in words a person in the room can follow. `up`: unit, frame rig.
std::string DescribePlace(const std::vector<BundleCamera>& cameras, const WavedGrid& grid,
                          const Eigen::Vector3d& point_m, const Eigen::Vector3d& direction,
                          const Eigen::Vector3d& up);

// Opposite to the mean downward direction of the images: cameras are seldom mounted otherwise.
Eigen::Vector3d EstimateUp(const std::vector<BundleCamera>& cameras);

}  // namespace rigcal::server
