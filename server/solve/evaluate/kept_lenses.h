// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// How far given intrinsics that a solution keeps put it off. Its covariance takes them for exact;
// those that the data would have are no measure of it either, because most of how they differ is
// their own noise, which may be many times that of the solution that keeps the given ones.
struct KeptLenses {
  // One sigma of what the given intrinsics are off, in sigmas of their priors. 0: the data show
  // nothing.
  double spread = 0;
  // What lies between the true parameters and those of the solution because of it: the second
  // moment of what is known of it. The length that gives the scale is held fixed. Empty where
  // `spread` is 0.
  std::vector<ReducedParameter> parameters;
  Eigen::MatrixXd moment;
};

// Empirical Bayes. The errors of the given intrinsics, in sigmas of their priors, are normal with
// one common variance s^2. The refined solution says what it is: with J the information that the
// data alone have about these intrinsics, what they would have them be scatters around the given
// ones with covariance s^2 I + J^-1, and s^2 is where that is most likely (Morris, Parametric
// Empirical Bayes Inference, Journal of the American Statistical Association 78, 1983). Given s^2,
// the errors are normal with precision J + I / s^2, and the poses follow them as they do in the
// refined solution.
//
// `refined`: the solution with refined intrinsics, of the same data (its observations are not
// needed); `uncertainty` is its own, of which the part by independent noise is used. `kept`: the
// cameras of the solution that keeps them, or that keeps some. `design_effect`: by how much the
// variance of errors that the data have in common exceeds that (BlockScatter).
KeptLenses MeasureKeptLenses(const std::vector<BundleCamera>& kept, const BundleProblem& refined,
                             const RigUncertainty& uncertainty, double design_effect);

// Whether the data of a large rig say that given intrinsics which its solution keeps differ from
// the true ones by more than chance, as MeasureKeptLenses asks first: camera by camera, here of one
// step of the solve with all intrinsics free. True where that cannot be told.
bool LensesMayDiffer(const RigObservations& rig, const RigSolution& solution,
                     const RigSolveOptions& options, double design_effect);

// An uncertainty with what the kept intrinsics add to its parameters and its shape; covariance of
// the scale included where it was.
RigUncertainty WithKeptLenses(const RigUncertainty& uncertainty, const KeptLenses& lenses);

}  // namespace rigcal::server
