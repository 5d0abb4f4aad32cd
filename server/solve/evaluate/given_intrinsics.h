// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/evaluate/uncertainty.h"

namespace rigcal::server {

struct GivenIntrinsicsTest {
  bool agrees = true;           // no camera disagrees, nor do all of them together
  std::vector<bool> disagrees;  // by camera: its own intrinsics are seen to be others
};

// Are the intrinsics that were given the true ones? Wald's test (Tests of Statistical Hypotheses
// Concerning Several Parameters, Transactions of the AMS 54, 1943) of those of a solution that
// refined them: their difference from the given ones against its covariance if the given ones are
// true, which the priors make smaller than that of the estimate itself. Each camera is tested, and
// all together; the probability that one of these tests fails though all that was given is true is
// at most `significance` (Bonferroni). It rises with the number of times that one looks.
//
// The given intrinsics are the means of the priors, `uncertainty` is that of the refined solution.
// Cameras whose intrinsics are not refined agree.
GivenIntrinsicsTest TestGivenIntrinsics(const BundleProblem& refined,
                                        const RigUncertainty& uncertainty,
                                        double significance = 0.01);

}  // namespace rigcal::server
