// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/bundle/line_bundle_kernel.h"

namespace rigcal::server {

// A normal prior on a free parameter, or on the difference of two: (plus - minus - mean) / sigma.
struct ReducedPrior {
  int plus = -1;   // column
  int minus = -1;  // column; -1: none
  double mean = 0;
  double inverse_sigma = 0;
};

// A normal prior on the distance between the centres of two cameras.
struct ReducedDistance {
  int camera_a = 0, camera_b = 0;
  int pose_a = -1, pose_b = -1;  // first of six columns; -1: fixed
  double mean = 0;
  double inverse_sigma = 0;
};

// The free parameters besides the instants, in columns: camera by camera (camera_order.h) its pose,
// its intrinsics, its line delay and the clocks it is the first to use, then the marker positions.
// In a large sparse rig, clocks of several cameras come after the cameras.
struct LineBundleLayout {
  struct View {
    int camera = 0;
    int clock = 0;
  };
  std::vector<ReducedParameter> parameters;
  std::vector<ReducedPrior> priors;
  std::optional<ReducedDistance> distance;
  std::vector<View> views;
  std::vector<KernelColumns> columns;  // by view
  int spacing_column = -1;
  std::vector<int> view_index;  // by camera, by clock; -1: no used marker
  int clock_count = 0;

  int column_count() const { return static_cast<int>(parameters.size()); }
  int& ViewIndex(int camera, int clock) {
    return view_index[static_cast<size_t>(camera * clock_count + clock)];
  }
  int ViewIndex(int camera, int clock) const {
    return view_index[static_cast<size_t>(camera * clock_count + clock)];
  }
};

LineBundleLayout LayOut(const BundleProblem& problem);

}  // namespace rigcal::server
