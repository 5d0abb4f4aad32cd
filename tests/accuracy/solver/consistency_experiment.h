// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tests/accuracy/rig/rig_covariance.h"

namespace rigcal::accuracy {

// Consistency of the solver's uncertainty with its errors. The ground truth is drawn from every
// prior: spans with their tolerance, intrinsics with the solver's prior, clock offsets. Everything
// is estimated. Cameras are synchronous, so that the bound at the ground truth can be computed too.
struct ConsistencyOptions {
  int camera_count = 6;
  double duration_s = 40;
  double offset_sigma_s = 0.005;  // of each camera's clock
  double outlier_share = 0.02;
};

struct ConsistencyTrial {
  absl::Status status;
  std::optional<RigNees> stated;  // against the solver's covariance, if it has one
  RigNees bound;                  // against the Cramer-Rao bound at the ground truth
  // Squared errors over the sigmas in the result, each value on its own; empty if the result has
  // no sigma.
  std::vector<double> rotation, position, time_offset, intrinsics, scale;
};

ConsistencyTrial RunConsistencyTrial(const ConsistencyOptions& options, uint32_t seed);

// One line of the table.
struct ConsistencyPart {
  std::string name;
  NeesSum stated;
  NeesSum bound;
};
std::vector<ConsistencyPart> SummariseParts(const std::vector<ConsistencyTrial>& trials);

// Mean over the trials of the mean of each; the interval is 2.58 standard errors from the scatter
// of the trials, as values within one are not independent. No trials: no sigma was stated.
struct MarginalPart {
  std::string name;
  int trials = 0;
  double mean = 0;
  Interval interval;
};
std::vector<MarginalPart> SummariseSigmas(const std::vector<ConsistencyTrial>& trials);

}  // namespace rigcal::accuracy
