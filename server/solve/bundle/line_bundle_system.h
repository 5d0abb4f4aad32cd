// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle_estimate.h"
#include "server/solve/bundle/line_bundle_layout.h"
#include "server/solve/bundle/line_bundle_packing.h"
#include "server/solve/bundle/line_bundle_part.h"

namespace rigcal::server {

// The normal equations of a line bundle: accumulated with the instants eliminated on the way, and
// solved. Keeps its memory from one iteration to the next.
class LineBundleSystem {
 public:
  LineBundleSystem(const BundleOptions& options, const LineBundleLayout& layout,
                   const PackedMarkers& packed, const LineBundleKernel& kernel);

  // False where a used marker cannot be seen. `damping` scales the diagonal that is added.
  bool Linearise(const LineBundleEstimate& estimate, double damping);
  double cost() const { return cost_; }                  // priors included
  double gradient_max() const { return gradient_max_; }  // over all parameters, instants included
  const Eigen::MatrixXd& matrix() const { return matrix_; }  // lower triangle, instants eliminated

  struct Move {
    bool valid = false;
    double cost = 0;
    double model_decrease = 0;
    double step_norm = 0;
    double norm = 0;
  };
  // The step from the last linearisation and the cost there, into `moved`. Not valid: the matrix is
  // not positive definite, the step not finite, or a marker no longer in sight. Destroys matrix().
  Move Solve(const LineBundleEstimate& estimate, LineBundleEstimate* moved);
  // Infinite where a used marker cannot be seen.
  double Cost(const LineBundleEstimate& estimate);

 private:
  void Assemble(const LineBundleEstimate& estimate);
  void ScatterViewSums();
  KernelStepResult SumSteps() const;

  const LineBundleLayout& layout_;
  const PackedMarkers& packed_;
  const LineBundleKernel& kernel_;
  KernelInput input_;
  std::vector<LineBundlePart> parts_;
  AlignedBuffer factors_, tiles_, view_sums_;
  Eigen::MatrixXd matrix_;
  Eigen::VectorXd gradient_, reduced_gradient_, diagonal_, step_;
  double damping_ = 0;
  double cost_ = 0;
  double gradient_max_ = 0;
};

}  // namespace rigcal::server
