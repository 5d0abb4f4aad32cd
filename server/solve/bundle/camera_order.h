// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// The cameras that see a used marker, each once, in the order in which their parameters are best
// laid out. In a large rig, where a camera shares instants with few others, cameras that share
// instants stand near each other, so that the reduced matrix is zero far from its diagonal (reverse
// Cuthill-McKee order: Cuthill and McKee 1969; George and Liu 1981, Computer Solution of Large
// Sparse Positive Definite Systems, chapter 4). Else as they are numbered.
struct CameraOrder {
  std::vector<int> cameras;
  bool is_sparse = false;
};

CameraOrder OrderCameras(const BundleProblem& problem);

}  // namespace rigcal::server
