// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle_layout.h"
#include "server/solve/bundle/line_bundle_packing.h"

namespace rigcal::server {

// The estimates of a line bundle as the kernel reads them: cameras, clocks and target as in the
// problem, the instants' poses in lanes.
class LineBundleEstimate {
 public:
  LineBundleEstimate(const BundleProblem& problem, const LineBundleLayout& layout,
                     const PackedMarkers& packed);

  KernelEstimate View() const { return {views_.data(), positions_.data(), poses_.data()}; }
  double* poses() { return poses_.data(); }

  // Becomes `from` with the reduced parameters stepped; the poses stay what they are.
  void MoveReduced(const LineBundleEstimate& from, const Eigen::VectorXd& step);
  double PriorCost() const;
  // Adds the priors' part, lower triangle. Of an Eigen::MatrixXd or an EnvelopeMatrix.
  template <typename Matrix>
  void AddPriors(Matrix* matrix, Eigen::VectorXd* gradient) const;
  double ReducedNorm2() const;
  void Store(const PackedMarkers& packed, BundleProblem* problem) const;

 private:
  // Where a parameter's value lies; null: a rotation, which has only steps.
  template <typename Self>
  static auto* ValueOf(Self* self, const ReducedParameter& parameter);
  double Value(int column) const;
  double PriorResidual(const ReducedPrior& prior) const;
  // From the centre of camera a to that of b.
  Eigen::Vector3d Difference(const ReducedDistance& distance) const;
  template <typename Matrix>
  void AddDistance(const ReducedDistance& distance, Matrix* matrix,
                   Eigen::VectorXd* gradient) const;
  void RefreshViews();

  const LineBundleLayout* layout_;
  std::vector<BundleCamera> cameras_;
  std::vector<BundleClock> clocks_;
  std::vector<double> positions_;
  std::vector<ViewEstimate<double>> views_;
  AlignedBuffer poses_;
};

}  // namespace rigcal::server
