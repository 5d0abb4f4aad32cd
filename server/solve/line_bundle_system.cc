// SPDX-License-Identifier: Apache-2.0
#include "server/solve/line_bundle_system.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace rigcal::server {
namespace {

// A batch's coupling should stay in the second-level cache while it is multiplied with itself.
constexpr size_t kBatchBytes = 512 * 1024;

// Adds the time of its life to a counter.
class ScopedTimer {
 public:
  explicit ScopedTimer(double* seconds)
      : seconds_(seconds), begin_(std::chrono::steady_clock::now()) {}
  ~ScopedTimer() {
    *seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }
  ScopedTimer(const ScopedTimer&) = delete;
  ScopedTimer& operator=(const ScopedTimer&) = delete;

 private:
  double* seconds_;
  std::chrono::steady_clock::time_point begin_;
};

size_t TileOffset(int row, int column) {
  const auto r = static_cast<size_t>(row), c = static_cast<size_t>(column);
  return r * (r + 1) / 2 + c;
}

// Element of the tiled lower triangle, row >= column.
double TileElement(const double* tiles, int row, int column) {
  return tiles[TileOffset(row / kTileSize, column / kTileSize) * kTileSize * kTileSize +
               static_cast<size_t>(row % kTileSize * kTileSize + column % kTileSize)];
}

KernelLoss ToKernelLoss(BundleLoss loss) {
  switch (loss) {
    case BundleLoss::kHuber:
      return KernelLoss::kHuber;
    case BundleLoss::kCauchy:
      return KernelLoss::kCauchy;
    case BundleLoss::kNone:
      break;
  }
  return KernelLoss::kNone;
}

double SumLanes(const double* lanes) {
  return ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])) +
         ((lanes[4] + lanes[5]) + (lanes[6] + lanes[7]));
}

// Columns of the reduced system in the order of a view's sums; the gradient's is column_count.
std::vector<int> LocalColumns(const KernelInput& input, const KernelColumns& columns) {
  std::vector<int> local;
  for (int i = 0; i < columns.pose_count(); ++i) local.push_back(columns.pose + i);
  for (int i = 0; i < columns.base_count; ++i) local.push_back(columns.base_column[i]);
  local.push_back(input.column_count);
  for (int i = static_cast<int>(local.size()); i < input.LocalCount(columns); ++i) {
    local.push_back(input.spacing_column + i - columns.pose_count() - columns.base_count - 1);
  }
  return local;
}

void SetBits(int column, uint64_t bits, uint64_t* masks) {
  if (column >= 0) masks[column / kTileSize] |= bits;
}

}  // namespace

LineBundleSystem::LineBundleSystem(const BundleOptions& options, const LineBundleLayout& layout,
                                   const PackedMarkers& packed, const LineBundleKernel& kernel,
                                   LineBundleTimes* times)
    : layout_(layout), packed_(packed), kernel_(kernel), times_(times) {
  input_.loss = ToKernelLoss(options.loss);
  input_.loss_scale = options.loss_scale;
  input_.marker_count = packed.marker_count;
  input_.column_count = layout.column_count();
  input_.spacing_column = layout.spacing_column;
  input_.group_count = packed.group_count();
  input_.view_count = static_cast<int>(layout.views.size());
  input_.columns = layout.columns.data();
  input_.entries = packed.entries.data();
  input_.first_entry = packed.first_entry.data();
  input_.data = packed.data.data();

  const auto tiles = static_cast<size_t>(input_.tile_count());
  const size_t panel = static_cast<size_t>(kTileSize * kInstantColumns * kGroupSize);
  batch_groups_ = static_cast<int>(
      std::clamp<size_t>(kBatchBytes / (tiles * panel * sizeof(double)), 1, kMaxBatchGroups));
  input_.batch_groups = batch_groups_;
  coupling_ = AlignedBuffer(tiles * panel * static_cast<size_t>(batch_groups_));
  tiles_ = AlignedBuffer(tiles * (tiles + 1) / 2 * kTileSize * kTileSize);
  factors_ = AlignedBuffer(static_cast<size_t>(input_.group_count * kFactorLanes * kGroupSize));

  size_t sums = 0;
  std::vector<size_t> offsets;
  for (const KernelColumns& columns : layout.columns) {
    const auto count = static_cast<size_t>(input_.LocalCount(columns));
    offsets.push_back(sums);
    sums += count * (count + 1) / 2 * kGroupSize;
  }
  view_sums_ = AlignedBuffer(sums);
  for (const size_t offset : offsets) view_sums_of_.push_back(view_sums_.data() + offset);

  const int batches = (input_.group_count + batch_groups_ - 1) / batch_groups_;
  masks_.assign(static_cast<size_t>(batches) * tiles, 0);
  for (int group = 0; group < input_.group_count; ++group) {
    uint64_t* const masks = masks_.data() + static_cast<size_t>(group / batch_groups_) * tiles;
    for (uint32_t e = input_.first_entry[group]; e < input_.first_entry[group + 1]; ++e) {
      const KernelEntry& entry = input_.entries[e];
      const uint64_t bits = static_cast<uint64_t>(entry.lanes)
                            << (group % batch_groups_ * kGroupSize);
      for (const int column :
           LocalColumns(input_, layout.columns[static_cast<size_t>(entry.view)])) {
        SetBits(column, bits, masks);
      }
    }
  }
  const int n = layout.column_count();
  matrix_.resize(n, n);
  gradient_.resize(n);
  reduced_gradient_.resize(n);
  diagonal_.resize(n);
  step_.resize(n);
}

void LineBundleSystem::AccumulateBatch(const LineBundleEstimate& estimate, int first, int last,
                                       KernelLinearisation* result) {
  const auto tiles = static_cast<size_t>(input_.tile_count());
  {
    const ScopedTimer timer(&times_->linearise_s);
    kernel_.linearise(input_, estimate.View(), damping_, first, last, factors_.data(),
                      view_sums_of_.data(), coupling_.data(), result);
  }
  const ScopedTimer timer(&times_->eliminate_s);
  kernel_.whiten(input_, first, last, factors_.data(), coupling_.data());
  kernel_.eliminate(input_.tile_count(), batch_groups_,
                    masks_.data() + static_cast<size_t>(first / batch_groups_) * tiles,
                    coupling_.data(), tiles_.data());
}

void LineBundleSystem::ScatterViewSums() {
  const int n = input_.column_count;
  for (size_t view = 0; view < layout_.columns.size(); ++view) {
    const std::vector<int> local = LocalColumns(input_, layout_.columns[view]);
    const double* lanes = view_sums_of_[view];
    for (size_t i = 0; i < local.size(); ++i) {
      for (size_t j = 0; j <= i; ++j, lanes += kGroupSize) {
        const int row = std::max(local[i], local[j]), column = std::min(local[i], local[j]);
        if (column == n) continue;  // the sum of squares itself
        if (row == n) {
          gradient_[column] += SumLanes(lanes);
        } else {
          matrix_(row, column) += SumLanes(lanes);
        }
      }
    }
  }
}

void LineBundleSystem::Assemble(const LineBundleEstimate& estimate) {
  const int n = input_.column_count;
  matrix_.setZero();
  gradient_.setZero();
  ScatterViewSums();
  estimate.AddPriors(&matrix_, &gradient_);
  diagonal_ = matrix_.diagonal().cwiseMax(kMinDiagonal).cwiseMin(kMaxDiagonal);
  matrix_.diagonal() += damping_ * diagonal_;
  for (int column = 0; column < n; ++column) {
    for (int row = column; row < n; ++row) {
      matrix_(row, column) += TileElement(tiles_.data(), row, column);
    }
    reduced_gradient_[column] = gradient_[column] + TileElement(tiles_.data(), n, column);
  }
  if (n > 0) gradient_max_ = std::max(gradient_max_, gradient_.cwiseAbs().maxCoeff());
}

bool LineBundleSystem::Linearise(const LineBundleEstimate& estimate, double damping) {
  damping_ = damping;
  tiles_.Fill(0);
  view_sums_.Fill(0);
  KernelLinearisation result;
  for (int first = 0; first < input_.group_count; first += batch_groups_) {
    AccumulateBatch(estimate, first, std::min(first + batch_groups_, input_.group_count), &result);
  }
  gradient_max_ = result.gradient_max;
  cost_ = result.cost + estimate.PriorCost();
  const ScopedTimer timer(&times_->solve_s);
  Assemble(estimate);
  return result.valid && std::isfinite(cost_);
}

LineBundleSystem::Move LineBundleSystem::Solve(const LineBundleEstimate& estimate,
                                               LineBundleEstimate* moved) {
  Move move;
  {
    const ScopedTimer timer(&times_->solve_s);
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>, Eigen::Lower> cholesky(matrix_);
    if (cholesky.info() != Eigen::Success) return move;
    step_ = -reduced_gradient_;
    cholesky.solveInPlace(step_);
  }
  if (!step_.allFinite()) return move;
  const ScopedTimer timer(&times_->step_s);
  moved->MoveReduced(estimate, step_);
  KernelStepResult result;
  kernel_.step(input_, estimate.View(), damping_, step_.data(), factors_.data(), moved->View(),
               moved->poses(), &result);
  move.cost = result.cost + moved->PriorCost();
  move.model_decrease =
      result.model_decrease +
      0.5 * step_.dot((damping_ * diagonal_.cwiseProduct(step_) - gradient_).eval());
  move.step_norm = std::sqrt(step_.squaredNorm() + result.step_norm2);
  move.norm = std::sqrt(estimate.ReducedNorm2() + result.norm2 +
                        static_cast<double>(packed_.instants.size()));
  move.valid = result.valid && std::isfinite(move.cost) && std::isfinite(move.step_norm);
  return move;
}

double LineBundleSystem::Cost(const LineBundleEstimate& estimate) const {
  KernelStepResult result;
  kernel_.evaluate(input_, estimate.View(), &result);
  return result.valid ? result.cost + estimate.PriorCost()
                      : std::numeric_limits<double>::infinity();
}

}  // namespace rigcal::server
