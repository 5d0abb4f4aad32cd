// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/block_scatter.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "server/solve/bundle/bundle_path.h"

namespace rigcal::server {
namespace {

constexpr double kBlockS = 2, kMinBlockS = 0.5;
constexpr double kBlocksWanted = 10;
constexpr size_t kMinScatterBlocks = 4;
// Of what the data say about a direction, the part of one block that is believed: more is a block
// that determines it alone, whose residuals show nothing.
constexpr double kMaxShare = 0.95;
constexpr int kMaxLanczosSteps = 16;
constexpr double kNegligible = 1e-10;
constexpr double kNoPrior = 1e9;

double SecondsBetween(const BuiltProblem& built, size_t from, size_t to) {
  return 1e-9 * static_cast<double>(built.instant_time_ns[to] - built.instant_time_ns[from]);
}

// Instants [first, last) as a problem of their own, without priors.
BundleProblem Slice(const BundleProblem& problem, size_t first, size_t last) {
  BundleProblem slice;
  slice.cameras = problem.cameras;
  for (BundleCamera& camera : slice.cameras) {
    // Those held fixed by a sigma of 0 stay so.
    camera.intrinsics_sigma =
        (camera.intrinsics_sigma.array() > 0).select(kNoPrior, camera.intrinsics_sigma);
  }
  slice.clocks = problem.clocks;
  for (BundleClock& clock : slice.clocks) clock.offset_sigma_s = clock.rate_sigma = 0;
  slice.target = problem.target;
  slice.target.span_sigma_m = kNoPrior;
  for (BundleWand& wand : slice.target.wands) wand.span_sigma_m = kNoPrior;
  slice.rigid_target = problem.rigid_target;
  for (double& sigma_m : slice.rigid_target.sigma_m) {
    if (sigma_m > 0) sigma_m = kNoPrior;
  }
  for (size_t i = first; i < last; ++i) {
    BundleInstant instant = problem.instants[i];
    if (!instant.used) continue;
    instant.first_observation = static_cast<int>(slice.observations.size());
    for (BundleObservation observation : problem.ObservationsOf(problem.instants[i])) {
      const auto markers = problem.MarkersOf(observation);
      observation.first_marker = static_cast<int>(slice.markers.size());
      slice.markers.insert(slice.markers.end(), markers.begin(), markers.end());
      slice.observations.push_back(observation);
    }
    slice.instants.push_back(instant);
  }
  return slice;
}

// Rows are those of `parameters`; none where the block says nothing.
std::optional<BlockInformation> Inform(const BundleOptions& options, const BundleProblem& slice,
                                       const std::vector<ReducedParameter>& parameters) {
  if (slice.instants.empty()) return std::nullopt;
  const auto own = ComputeInformation(options, slice);
  if (!own.ok() || own->gradient.size() != own->information.rows()) return std::nullopt;
  BlockInformation block{{}, own->information, -own->gradient};
  for (const ReducedParameter& parameter : own->parameters) {
    const auto found = std::find(parameters.begin(), parameters.end(), parameter);
    if (found == parameters.end()) return std::nullopt;
    block.rows.push_back(found - parameters.begin());
  }
  return block;
}

// (I - A)^(-1/2) z for a symmetric A with eigenvalues from 0 to 1, those above kMaxShare taken for
// that. By Lanczos's method (Golub and Van Loan, Matrix Computations, section 10.2), which needs
// products with A alone.
template <typename Product>
Eigen::VectorXd InverseRootTimes(const Product& product, const Eigen::VectorXd& z) {
  const double norm = z.norm();
  if (!(norm > 0)) return z;
  const auto steps = std::min<Eigen::Index>(kMaxLanczosSteps, z.size());
  Eigen::MatrixXd basis(z.size(), steps);
  Eigen::VectorXd diagonal(steps), beside(steps);
  basis.col(0) = z / norm;
  Eigen::Index used = 0;
  while (used < steps) {
    Eigen::VectorXd next = product(basis.col(used));
    diagonal[used] = basis.col(used).dot(next);
    ++used;
    // Twice is enough (Kahan and Parlett).
    for (int i = 0; i < 2; ++i) {
      const Eigen::VectorXd along = basis.leftCols(used).transpose() * next;
      next.noalias() -= basis.leftCols(used) * along;
    }
    beside[used - 1] = next.norm();
    if (used == steps || beside[used - 1] < kNegligible) break;
    basis.col(used) = next / beside[used - 1];
  }
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen;
  eigen.computeFromTridiagonal(diagonal.head(used), beside.head(used - 1));
  const Eigen::ArrayXd share = eigen.eigenvalues().array().max(0).min(kMaxShare);
  const Eigen::VectorXd first = eigen.eigenvectors().row(0).transpose();
  const Eigen::VectorXd weights =
      eigen.eigenvectors() * ((1 - share).rsqrt() * first.array()).matrix();
  return norm * (basis.leftCols(used) * weights);
}

}  // namespace

std::vector<size_t> CutIntoBlocks(const BuiltProblem& built) {
  const size_t count = built.problem.instants.size();
  std::vector<size_t> cuts;
  if (count == 0) return cuts;
  // Pauses and the gaps between sessions are not part of what was recorded.
  double recorded_s = 0;
  for (size_t i = 1; i < count; ++i) {
    recorded_s += std::clamp(SecondsBetween(built, i - 1, i), 0.0, kMinBlockS);
  }
  const double length_s = std::clamp(recorded_s / kBlocksWanted, kMinBlockS, kBlockS);
  for (size_t i = 0; i < count; ++i) {
    const double elapsed_s = i == 0 ? 0 : SecondsBetween(built, cuts.back(), i);
    if (i == 0 || elapsed_s < 0 || elapsed_s >= length_s) cuts.push_back(i);
  }
  cuts.push_back(count);
  return cuts;
}

BlockScatterSum::BlockScatterSum(const Eigen::MatrixXd& covariance, const LossFactors& loss)
    : loss_(loss), units_(covariance.diagonal().cwiseSqrt()) {
  // In units in which every parameter of independent errors has the variance `variance`.
  const Eigen::VectorXd per_unit = units_.cwiseInverse();
  is_valid_ = per_unit.allFinite();
  if (!is_valid_) return;
  whole_ = per_unit.asDiagonal() * covariance * per_unit.asDiagonal() / loss.variance;
}

// With C = R R^T the covariance of the block's own parameters, the block's information H is
// R^T H R in units in which independent errors have that of the identity.
void BlockScatterSum::Add(const BlockInformation& block) {
  if (!is_valid_) return;
  // In a large rig a block is seen by few of the cameras.
  const Eigen::MatrixXd covariance = whole_(block.rows, block.rows);
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  is_valid_ = factor.info() == Eigen::Success;
  if (!is_valid_) return;
  const Eigen::MatrixXd root = factor.matrixL();
  const Eigen::VectorXd units = units_(block.rows);
  const Eigen::MatrixXd information = units.asDiagonal() * block.information * units.asDiagonal();
  const Eigen::VectorXd score = root.transpose() * units.cwiseProduct(block.score) /
                                (loss_.slope * std::sqrt(loss_.variance));
  const auto product = [&](const Eigen::VectorXd& v) -> Eigen::VectorXd {
    return root.transpose() * (information * (root * v).eval()).eval();
  };
  const Eigen::VectorXd corrected = InverseRootTimes(product, score);
  squares_ += corrected.squaredNorm();
  // trace(R^T H R) = trace(H C)
  share_ += information.cwiseProduct(covariance).sum();
  const Eigen::VectorXd own = factor.matrixU().solve(corrected);
  changes_.push_back(std::sqrt(loss_.variance) *
                     units_.cwiseProduct((whole_(Eigen::all, block.rows) * own).eval()));
}

BlockScatter BlockScatterSum::Finish() const {
  BlockScatter scatter;
  if (!is_valid_ || changes_.size() < kMinScatterBlocks) return scatter;
  scatter.changes.resize(units_.size(), static_cast<Eigen::Index>(changes_.size()));
  for (size_t b = 0; b < changes_.size(); ++b) {
    scatter.changes.col(static_cast<Eigen::Index>(b)) = changes_[b];
  }
  scatter.design_effect = share_ > 0 ? squares_ / share_ : 1;
  return scatter;
}

BlockScatter MeasureBlockScatter(const BuiltProblem& built, const BundleOptions& options,
                                 const std::vector<ReducedParameter>& parameters,
                                 const Eigen::MatrixXd& covariance, const LossFactors& loss) {
  const std::vector<size_t> cuts = CutIntoBlocks(built);
  if (cuts.size() <= kMinScatterBlocks) return {};
  BlockScatterSum sum(covariance, loss);
  for (size_t b = 0; b + 1 < cuts.size(); ++b) {
    const auto block = Inform(options, Slice(built.problem, cuts[b], cuts[b + 1]), parameters);
    if (block) sum.Add(*block);
  }
  return sum.Finish();
}

}  // namespace rigcal::server
