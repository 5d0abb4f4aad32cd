// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "server/solve/bundle/line_bundle_kernel.h"
#include "server/solve/bundle/line_bundle_layout.h"
#include "server/solve/bundle/line_bundle_packing.h"

namespace rigcal::server {

// A run of groups of a line bundle with the sums over them. A system is cut into parts by its size
// alone, and the parts' sums are added in their order.
class LineBundlePart {
 public:
  // Groups [first, last) of `whole`.
  LineBundlePart(const KernelInput& whole, const LineBundleLayout& layout, int first, int last);

  // Sums of the last linearisation. `factors` are those of the whole system.
  void Linearise(const LineBundleKernel& kernel, const KernelEstimate& estimate, double damping,
                 double* factors);
  // The part's instants step; see LineBundleKernel::step. Poses and factors are those of the whole.
  void Step(const LineBundleKernel& kernel, const KernelEstimate& estimate, double damping,
            const double* reduced_step, const double* factors, const KernelEstimate& moved,
            double* moved_poses);
  void Evaluate(const LineBundleKernel& kernel, const KernelEstimate& estimate);

  const KernelLinearisation& linearisation() const { return linearisation_; }
  const KernelStepResult& step() const { return step_; }
  const AlignedBuffer& tiles() const { return tiles_; }
  const AlignedBuffer& view_sums() const { return view_sums_; }

 private:
  KernelEstimate Mine(KernelEstimate whole) const;

  KernelInput input_;
  int first_;
  std::vector<uint64_t> masks_;  // by batch, by tile
  AlignedBuffer coupling_, tiles_, view_sums_;
  std::vector<double*> view_sums_of_;
  KernelLinearisation linearisation_;
  KernelStepResult step_;
};

// Columns of the reduced system in the order of a view's sums; the gradient's is column_count.
std::vector<int> LocalColumns(const KernelInput& input, const KernelColumns& columns);

}  // namespace rigcal::server
