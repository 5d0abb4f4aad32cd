// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "common/simulation/world/simulated_world.h"

namespace rigcal::accuracy {

// Cells along each axis of the box in which the wand's markers were.
inline constexpr int kVoxelsPerSide = 3;

// Errors of triangulated points in one cell of space, and what was predicted for these points.
struct VoxelErrors {
  double squared_m2 = 0;    // sum of squared errors
  double predicted_m2 = 0;  // sum of squared one sigmas of ComputeAccuracy (RPC GetAccuracy)
  double stated_m2 = 0;     // and of the points' own covariance
  double nees = 0;          // sum of the normalised errors squared, by the own covariance
  int count = 0;

  void Add(const VoxelErrors& other);
};

struct TriangulateTrial {
  absl::Status status;
  std::vector<VoxelErrors> voxels;  // kVoxelsPerSide^3: x, then y, then z fastest
};

// Calibrates a simulated rig from the first part of a wave and triangulates the rest of it, in the
// frame of the reference camera.
TriangulateTrial RunTriangulateTrial(const SimulationOptions& simulation);

// All cells together.
VoxelErrors SumOf(const std::vector<VoxelErrors>& voxels);

}  // namespace rigcal::accuracy
