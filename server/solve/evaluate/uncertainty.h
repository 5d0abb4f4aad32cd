// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// Covariance of a solution. The scale is that of the target's whole length, or with one marker that
// of the distance of the problem (where it only names the unit, both covariances are the same). The
// reference camera's pose and, in each session, one clock are held fixed (rig_solver.h).
struct RigUncertainty {
  std::vector<ReducedParameter> parameters;  // the rows of the covariances
  Eigen::MatrixXd covariance;                // scale included
  Eigen::MatrixXd noise_covariance;          // the same if errors were independent (C below)
  Eigen::MatrixXd shape_covariance;          // the length that gives the scale held fixed
  double scale_sigma_rel = 0;                // of that length; 0: the scale is not known
  std::vector<CameraUncertainty> cameras;    // poses and intrinsics; of the shape
  std::vector<double> marker_position_sigma_m;
  double design_effect = 1;  // BlockScatter; 1: independent errors, or too few blocks to tell

  // Row of a parameter, or -1 where it is held fixed.
  Eigen::Index Row(const ReducedParameter& parameter) const;
  // One sigma of a sum of offsets (or rates), `weights` by clock.
  double ClockSigma(ReducedParameterKind kind, const std::vector<double>& weights) const;
};

// From the information of the bundle adjustment at its optimum. The data's part of it, in which the
// robust loss weighs the markers, is scaled by the variance of the residuals and what the loss
// makes of it (loss_factors.h). Priors count as given.
//
// That is the covariance C of independent errors. Where blocks of time scatter more than that
// (block_scatter.h, design effect D > 1), it becomes C / sqrt(D) + (1 - 1 / sqrt(D)) (S + C P C): S
// the scatter of the blocks, P the information of the priors. There are fewer blocks than
// parameters, so S alone is singular; the part of C keeps it regular, and where the blocks show
// nothing it is all there is (shrinkage, Ledoit and Wolf 2004).
//
// Where the target was followed through time, all this is of the rows and their path: information
// with the path eliminated, and every row's score with what the path gives way.
//
// INTERNAL: a parameter is not determined by the data.
absl::StatusOr<RigUncertainty> ComputeUncertainty(const RigSolution& solution,
                                                  const RigSolveOptions& options);

// Of independent errors alone, by instants: `parameters`, and both `covariance` and
// `noise_covariance`; nothing else. Errors as above.
absl::StatusOr<RigUncertainty> ComputeNoiseUncertainty(const RigSolution& solution);

// Fills `cameras` from the covariances.
void DescribeCameras(const BundleProblem& problem, RigUncertainty* uncertainty);

// The shape's covariance in the form of CalibrationResult::camera_covariance. Parameters that were
// held fixed, or that no marker touches, have zeros. `reference_camera` -1: every camera has rows.
std::vector<double> PackCameraCovariance(const BundleProblem& problem, int reference_camera,
                                         const RigUncertainty& uncertainty);

}  // namespace rigcal::server
