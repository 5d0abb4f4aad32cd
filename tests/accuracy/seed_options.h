// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "tests/accuracy/experiment.h"

namespace rigcal::accuracy {

// Options of the experiments that run over many seeds.
struct SeedOptions {
  int count = 100;
  int first = 1;
  int threads = 2;
  int camera_count = 6;
  double duration_s = 40;
  bool verbose = false;   // a line for each seed
  bool spline = false;    // follow the target through time (TrajectoryChoice::kSpline)
  bool instants = false;  // do not (TrajectoryChoice::kInterpolated)
  std::string only;       // cases with this in their name; empty: all
};

// An experiment with these options; `defaults` are its own.
Experiment SeedExperiment(const std::string& name, const std::string& summary,
                          const SeedOptions& defaults,
                          const std::function<int(const SeedOptions&)>& run);

}  // namespace rigcal::accuracy
