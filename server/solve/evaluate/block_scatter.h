// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/evaluate/loss_factors.h"
#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

// What blocks of time say about the errors that their observations have in common: the light on the
// spheres, a lens that the model cannot hold at these places, a wand that is not straight. A
// covariance by the noise of the single centres knows nothing of them.
//
// Each block's score (the gradient of its part of the cost) is turned into the change of the
// parameters that it stands for. The sum of the outer products of these is the cluster-robust
// covariance (White 1980; Liang and Zeger 1986), with the small-sample correction CR2 (Bell and
// McCaffrey 2002; Cameron and Miller, A Practitioner's Guide to Cluster-Robust Inference, 2015,
// section VI.B), which has the right expectation where the errors are independent.
struct BlockScatter {
  Eigen::MatrixXd changes;  // one column for each block, rows as the parameters
  // Their variance by that which independent errors would give, mean over the parameters (Kish's
  // design effect): 1 where the errors are independent.
  double design_effect = 1;
  int block_count() const { return static_cast<int>(changes.cols()); }
};

// Runs of instants of at most 2 s, of less in short recordings; indices of the first instant of
// each, and the number of instants at the end.
std::vector<size_t> CutIntoBlocks(const BuiltProblem& built);

// A block's information about parameters, and its score.
struct BlockInformation {
  std::vector<Eigen::Index> rows;  // which parameters: those that it says nothing of are left out
  Eigen::MatrixXd information;
  Eigen::VectorXd score;
};

// Takes the blocks one after the other. `covariance` as by independent errors, priors included.
class BlockScatterSum {
 public:
  BlockScatterSum(const Eigen::MatrixXd& covariance, const LossFactors& loss);

  void Add(const BlockInformation& block);
  // Fewer than 4 blocks: no columns.
  BlockScatter Finish() const;

 private:
  LossFactors loss_;
  Eigen::VectorXd units_;
  Eigen::MatrixXd whole_;
  bool is_valid_ = false;  // the covariance is one
  std::vector<Eigen::VectorXd> changes_;
  double squares_ = 0, share_ = 0;
};

// `covariance` of `parameters` as by independent errors, priors included. Fewer than 4 blocks, or
// one that determines a parameter all by itself: no columns.
BlockScatter MeasureBlockScatter(const BuiltProblem& built, const BundleOptions& options,
                                 const std::vector<ReducedParameter>& parameters,
                                 const Eigen::MatrixXd& covariance, const LossFactors& loss);

}  // namespace rigcal::server
