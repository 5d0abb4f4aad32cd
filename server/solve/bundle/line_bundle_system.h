// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/envelope_matrix.h"
#include "server/solve/bundle/line_bundle_estimate.h"
#include "server/solve/bundle/line_bundle_kernel.h"
#include "server/solve/bundle/line_bundle_layout.h"
#include "server/solve/bundle/line_bundle_packing.h"

namespace rigcal::server {

// Where the tiles of the reduced matrix lie, and of the row below it that is the gradient's. Tile
// (i, j), i >= j, is number rows[i] + j; of each row of tiles those from the first are there that
// may differ from zero.
struct TileRows {
  std::vector<std::ptrdiff_t> rows;
  size_t count = 0;
};

// A run of groups of a line bundle with the sums over them. A system is cut into parts by its size
// alone, and the parts' sums are added in their order.
class LineBundlePart {
 public:
  // Groups [first, last) of `whole`. `tiles`: of the reduced matrix.
  LineBundlePart(const KernelInput& whole, const LineBundleLayout& layout, const TileRows& tiles,
                 int first, int last);

  // Sums of the last linearisation. `factors` are those of the whole system. `curved` as in
  // KernelInput; steps go by the last linearisation's.
  void Linearise(const LineBundleKernel& kernel, const KernelEstimate& estimate, double damping,
                 bool curved, double* factors);
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
  // The tiles that a batch reaches, in `batch_tiles_` and `masks_` from here on.
  struct Batch {
    size_t first_tile = 0;
    int tile_count = 0;
  };

  KernelEstimate Mine(KernelEstimate whole) const;
  // Returns the most tiles that a batch of `batch_groups` groups reaches.
  size_t CutIntoBatches(const std::vector<std::vector<int>>& tiles_of_view, int batch_groups);

  KernelInput input_;
  const TileRows& tile_rows_;
  int first_;
  std::vector<Batch> batches_;
  std::vector<int> batch_tiles_;
  std::vector<uint64_t> masks_;
  std::vector<int> places_;  // of the batch at work
  AlignedBuffer coupling_, tiles_, view_sums_;
  std::vector<double*> view_sums_of_;
  KernelLinearisation linearisation_;
  KernelStepResult step_;
};

// The normal equations of a line bundle: accumulated with the instants eliminated on the way, and
// solved. Keeps its memory from one iteration to the next.
class LineBundleSystem {
 public:
  LineBundleSystem(const BundleOptions& options, const LineBundleLayout& layout,
                   const PackedMarkers& packed, const LineBundleKernel& kernel);

  // False where a used marker cannot be seen. `damping` scales the diagonal that is added. Not
  // `curved`: the matrix is the information of the weighted residuals. Curved: nearer to the second
  // derivative of the cost, whose minimum it finds in fewer steps.
  bool Linearise(const LineBundleEstimate& estimate, double damping, bool curved);
  double cost() const { return cost_; }                  // priors included
  double gradient_max() const { return gradient_max_; }  // over all parameters, instants included
  const EnvelopeMatrix& matrix() const { return matrix_; }  // instants eliminated
  const Eigen::VectorXd& reduced_gradient() const { return reduced_gradient_; }  // likewise

  struct Move {
    bool valid = false;
    double cost = 0;
    double model_decrease = 0;
    double step_norm = 0;
    double norm = 0;
  };
  // The step from the last linearisation and the cost there, into `moved`. Not valid: the matrix is
  // not positive definite, the step not finite, or a marker no longer in sight.
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
  TileRows tile_rows_;
  std::vector<LineBundlePart> parts_;
  AlignedBuffer factors_, tiles_, view_sums_;
  EnvelopeMatrix matrix_;
  Eigen::VectorXd gradient_, reduced_gradient_, diagonal_, step_;
  double damping_ = 0;
  double cost_ = 0;
  double gradient_max_ = 0;
};

}  // namespace rigcal::server
