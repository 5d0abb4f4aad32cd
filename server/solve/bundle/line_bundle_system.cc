// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_system.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/solve/bundle/envelope_cholesky.h"

namespace rigcal::server {
namespace {

// A batch's coupling should stay in the second-level cache while it is multiplied with itself.
constexpr size_t kBatchBytes = 512 * 1024;
// Each part has a reduced matrix of its own. They decide the order of sums, and so the last digits.
constexpr int kMaxParts = 8;
// Of all parts' matrices: more take longer to add up than they save.
constexpr size_t kMaxTileBytes = 96 << 20;
constexpr int kMinGroupsPerPart = 16;

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

size_t TileOffset(int row, int column) {
  const auto r = static_cast<size_t>(row), c = static_cast<size_t>(column);
  return r * (r + 1) / 2 + c;
}

// Element of the tiled lower triangle, row >= column.
double TileElement(const double* tiles, int row, int column) {
  return tiles[TileOffset(row / kTileSize, column / kTileSize) * kTileSize * kTileSize +
               static_cast<size_t>(row % kTileSize * kTileSize + column % kTileSize)];
}

double SumLanes(const double* lanes) {
  return ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])) +
         ((lanes[4] + lanes[5]) + (lanes[6] + lanes[7]));
}

// One to kMaxParts, by the number of groups and columns alone.
std::vector<LineBundlePart> CutIntoParts(const KernelInput& input, const LineBundleLayout& layout) {
  const auto tiles = static_cast<size_t>(input.tile_count());
  const size_t bytes = tiles * (tiles + 1) / 2 * kTileSize * kTileSize * sizeof(double);
  const auto most = static_cast<int>(std::clamp<size_t>(kMaxTileBytes / bytes, 1, kMaxParts));
  const int count = std::clamp(input.group_count / kMinGroupsPerPart, 1, most);
  std::vector<LineBundlePart> parts;
  parts.reserve(static_cast<size_t>(count));
  for (int part = 0; part < count; ++part) {
    parts.emplace_back(input, layout, input.group_count * part / count,
                       input.group_count * (part + 1) / count);
  }
  return parts;
}

void AddTo(AlignedBuffer* sum, const AlignedBuffer& part) {
  double* const to = sum->data();
  const double* const from = part.data();
  for (size_t i = 0; i < part.size(); ++i) to[i] += from[i];
}

}  // namespace

LineBundlePart::LineBundlePart(const KernelInput& whole, const LineBundleLayout& layout, int first,
                               int last)
    : input_(whole), first_(first) {
  input_.group_count = last - first;
  input_.first_entry += first;
  input_.first_group = first;

  const auto tiles = static_cast<size_t>(input_.tile_count());
  const size_t panel = static_cast<size_t>(kTileSize * kInstantColumns * kGroupSize);
  input_.batch_groups = static_cast<int>(
      std::clamp<size_t>(kBatchBytes / (tiles * panel * sizeof(double)), 1, kMaxBatchGroups));
  coupling_ = AlignedBuffer(tiles * panel * static_cast<size_t>(input_.batch_groups));
  tiles_ = AlignedBuffer(tiles * (tiles + 1) / 2 * kTileSize * kTileSize);

  size_t sums = 0;
  std::vector<size_t> offsets;
  for (const KernelColumns& columns : layout.columns) {
    const auto count = static_cast<size_t>(input_.LocalCount(columns));
    offsets.push_back(sums);
    sums += count * (count + 1) / 2 * kGroupSize;
  }
  view_sums_ = AlignedBuffer(sums);
  for (const size_t offset : offsets) view_sums_of_.push_back(view_sums_.data() + offset);

  const int batches = (input_.group_count + input_.batch_groups - 1) / input_.batch_groups;
  masks_.assign(static_cast<size_t>(batches) * tiles, 0);
  for (int group = 0; group < input_.group_count; ++group) {
    uint64_t* const masks =
        masks_.data() + static_cast<size_t>(group / input_.batch_groups) * tiles;
    for (uint32_t e = input_.first_entry[group]; e < input_.first_entry[group + 1]; ++e) {
      const KernelEntry& entry = input_.entries[e];
      const uint64_t bits = static_cast<uint64_t>(entry.lanes)
                            << (group % input_.batch_groups * kGroupSize);
      for (const int column :
           LocalColumns(input_, layout.columns[static_cast<size_t>(entry.view)])) {
        if (column >= 0) masks[column / kTileSize] |= bits;
      }
    }
  }
}

KernelEstimate LineBundlePart::Mine(KernelEstimate whole) const {
  whole.poses += static_cast<size_t>(first_) * kPoseLanes * kGroupSize;
  return whole;
}

void LineBundlePart::Linearise(const LineBundleKernel& kernel, const KernelEstimate& estimate,
                               double damping, bool curved, double* factors) {
  input_.curved = curved;
  const auto tiles = static_cast<size_t>(input_.tile_count());
  const KernelEstimate mine = Mine(estimate);
  double* const my_factors = factors + static_cast<size_t>(first_) * kFactorLanes * kGroupSize;
  tiles_.Fill(0);
  view_sums_.Fill(0);
  linearisation_ = {};
  for (int first = 0; first < input_.group_count; first += input_.batch_groups) {
    const int last = std::min(first + input_.batch_groups, input_.group_count);
    kernel.linearise(input_, mine, damping, first, last, my_factors, view_sums_of_.data(),
                     coupling_.data(), &linearisation_);
    kernel.whiten(input_, first, last, my_factors, coupling_.data());
    kernel.eliminate(input_.tile_count(), input_.batch_groups,
                     masks_.data() + static_cast<size_t>(first / input_.batch_groups) * tiles,
                     coupling_.data(), tiles_.data());
  }
}

void LineBundlePart::Step(const LineBundleKernel& kernel, const KernelEstimate& estimate,
                          double damping, const double* reduced_step, const double* factors,
                          const KernelEstimate& moved, double* moved_poses) {
  step_ = {};
  kernel.step(input_, Mine(estimate), damping, reduced_step,
              factors + static_cast<size_t>(first_) * kFactorLanes * kGroupSize, Mine(moved),
              moved_poses + static_cast<size_t>(first_) * kPoseLanes * kGroupSize, &step_);
}

void LineBundlePart::Evaluate(const LineBundleKernel& kernel, const KernelEstimate& estimate) {
  step_ = {};
  kernel.evaluate(input_, Mine(estimate), &step_);
}

LineBundleSystem::LineBundleSystem(const BundleOptions& options, const LineBundleLayout& layout,
                                   const PackedMarkers& packed, const LineBundleKernel& kernel)
    : layout_(layout), packed_(packed), kernel_(kernel) {
  input_.robust = options.robust;
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
  if (packed.source != nullptr) {
    input_.source = &packed;
    input_.load = [](const void* source, int group) {
      static_cast<const PackedMarkers*>(source)->Load(group);
    };
  }
  parts_ = CutIntoParts(input_, layout);
  factors_ = AlignedBuffer(static_cast<size_t>(input_.group_count * kFactorLanes * kGroupSize));
  if (parts_.size() > 1) tiles_ = AlignedBuffer(parts_.front().tiles().size());
  view_sums_ = AlignedBuffer(parts_.front().view_sums().size());

  const int n = layout.column_count();
  matrix_.resize(n, n);
  gradient_.resize(n);
  reduced_gradient_.resize(n);
  diagonal_.resize(n);
  step_.resize(n);
}

void LineBundleSystem::ScatterViewSums() {
  const int n = input_.column_count;
  const double* lanes = view_sums_.data();
  for (const KernelColumns& columns : layout_.columns) {
    const std::vector<int> local = LocalColumns(input_, columns);
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
  const double* const tiles = (parts_.size() > 1 ? tiles_ : parts_.front().tiles()).data();
  for (int column = 0; column < n; ++column) {
    for (int row = column; row < n; ++row) {
      matrix_(row, column) += TileElement(tiles, row, column);
    }
    reduced_gradient_[column] = gradient_[column] + TileElement(tiles, n, column);
  }
  if (n > 0) gradient_max_ = std::max(gradient_max_, gradient_.cwiseAbs().maxCoeff());
}

bool LineBundleSystem::Linearise(const LineBundleEstimate& estimate, double damping, bool curved) {
  damping_ = damping;
  bool valid = true;
  gradient_max_ = 0;
  cost_ = estimate.PriorCost();
  if (parts_.size() > 1) tiles_.Fill(0);
  view_sums_.Fill(0);
  for (LineBundlePart& part : parts_) {
    part.Linearise(kernel_, estimate.View(), damping, curved, factors_.data());
    valid = valid && part.linearisation().valid;
    gradient_max_ = std::max(gradient_max_, part.linearisation().gradient_max);
    cost_ += part.linearisation().cost;
    if (parts_.size() > 1) AddTo(&tiles_, part.tiles());
    AddTo(&view_sums_, part.view_sums());
  }
  Assemble(estimate);
  return valid && std::isfinite(cost_);
}

KernelStepResult LineBundleSystem::SumSteps() const {
  KernelStepResult sum;
  for (const LineBundlePart& part : parts_) {
    sum.cost += part.step().cost;
    sum.valid = sum.valid && part.step().valid;
    sum.model_decrease += part.step().model_decrease;
    sum.step_norm2 += part.step().step_norm2;
    sum.norm2 += part.step().norm2;
  }
  return sum;
}

LineBundleSystem::Move LineBundleSystem::Solve(const LineBundleEstimate& estimate,
                                               LineBundleEstimate* moved) {
  Move move;
  const EnvelopeCholesky cholesky(matrix_);
  if (!cholesky.ok()) return move;
  step_ = cholesky.Solve(-reduced_gradient_);
  if (!step_.allFinite()) return move;
  moved->MoveReduced(estimate, step_);
  for (LineBundlePart& part : parts_) {
    part.Step(kernel_, estimate.View(), damping_, step_.data(), factors_.data(), moved->View(),
              moved->poses());
  }
  const KernelStepResult result = SumSteps();
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

double LineBundleSystem::Cost(const LineBundleEstimate& estimate) {
  for (LineBundlePart& part : parts_) part.Evaluate(kernel_, estimate.View());
  const KernelStepResult result = SumSteps();
  return result.valid ? result.cost + estimate.PriorCost()
                      : std::numeric_limits<double>::infinity();
}

}  // namespace rigcal::server
