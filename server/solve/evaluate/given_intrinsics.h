// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
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

// How much of the variance of the refined focal lengths and principal point (fx fy cx cy) is that
// of their priors, by camera: with S the covariance by independent noise of everything that was
// estimated and P the priors' information, (S P S)_ii / S_ii. 0: the data alone say it; 1: the
// priors do, also where all of them together hold what no single one does, such as a factor common
// to all focal lengths. Zeros where intrinsics are not refined.
std::vector<Eigen::Vector4d> PriorShares(const BundleProblem& refined,
                                         const RigUncertainty& uncertainty);

}  // namespace rigcal::server
