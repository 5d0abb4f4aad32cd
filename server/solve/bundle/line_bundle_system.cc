// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_system.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

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

// The reduced matrix, zero: what is coupled by an instant, by a camera or by a prior may differ
// from that. The target's columns are coupled with all.
EnvelopeMatrix Envelope(const KernelInput& input, const LineBundleLayout& layout) {
  std::vector<Eigen::Index> first(static_cast<size_t>(input.column_count));
  for (size_t i = 0; i < first.size(); ++i) first[i] = static_cast<Eigen::Index>(i);
  const auto reach = [&first](int row, Eigen::Index column) {
    Eigen::Index& own = first[static_cast<size_t>(row)];
    own = std::min(own, column);
  };
  std::vector<std::vector<int>> columns_of_view;
  std::vector<Eigen::Index> least;  // by view
  for (const KernelColumns& columns : layout.columns) {
    std::vector<int> own = LocalColumns(input, columns);
    std::erase_if(own, [&input](int column) {
      return column == input.column_count ||
             (input.spacing_column >= 0 && column >= input.spacing_column);
    });
    least.push_back(own.empty() ? input.column_count : *std::ranges::min_element(own));
    columns_of_view.push_back(std::move(own));
  }
  for (int group = 0; group < input.group_count; ++group) {
    for (int lane = 0; lane < kGroupSize; ++lane) {
      Eigen::Index from = input.column_count;
      for (const bool takes : {false, true}) {
        for (uint32_t e = input.first_entry[group]; e < input.first_entry[group + 1]; ++e) {
          const KernelEntry& entry = input.entries[e];
          if ((entry.lanes >> lane & 1u) == 0) continue;
          const auto view = static_cast<size_t>(entry.view);
          from = std::min(from, least[view]);
          if (!takes) continue;
          for (const int column : columns_of_view[view]) reach(column, from);
        }
      }
    }
  }
  if (input.spacing_column >= 0) {
    for (int column = input.spacing_column; column < input.column_count; ++column) reach(column, 0);
  }
  for (const ReducedPrior& prior : layout.priors) {
    if (prior.minus >= 0)
      reach(std::max(prior.plus, prior.minus), std::min(prior.plus, prior.minus));
  }
  if (layout.distance && layout.distance->pose_a >= 0 && layout.distance->pose_b >= 0) {
    const auto [a, b] = std::minmax(layout.distance->pose_a, layout.distance->pose_b);
    for (int i = 0; i < 6; ++i) reach(b + i, a);
  }
  return EnvelopeMatrix(first);
}

TileRows RowsOfTiles(const EnvelopeMatrix& matrix) {
  TileRows tiles;
  const auto columns = static_cast<int>(matrix.size());
  for (int row = 0; row <= columns / kTileSize; ++row) {
    const int last = (row + 1) * kTileSize - 1;
    // The row that has the gradient is whole.
    const int first =
        last < columns ? static_cast<int>(matrix.FirstOf(matrix.BlockOf(last))) / kTileSize : 0;
    tiles.rows.push_back(static_cast<std::ptrdiff_t>(tiles.count) - first);
    tiles.count += static_cast<size_t>(row - first + 1);
  }
  return tiles;
}

double SumLanes(const double* lanes) {
  return ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])) +
         ((lanes[4] + lanes[5]) + (lanes[6] + lanes[7]));
}

// One to kMaxParts, by the number of groups and tiles alone.
std::vector<LineBundlePart> CutIntoParts(const KernelInput& input, const LineBundleLayout& layout,
                                         const TileRows& tiles) {
  const size_t bytes = tiles.count * kTileSize * kTileSize * sizeof(double);
  const auto most = static_cast<int>(std::clamp<size_t>(kMaxTileBytes / bytes, 1, kMaxParts));
  const int count = std::clamp(input.group_count / kMinGroupsPerPart, 1, most);
  std::vector<LineBundlePart> parts;
  parts.reserve(static_cast<size_t>(count));
  for (int part = 0; part < count; ++part) {
    parts.emplace_back(input, layout, tiles, input.group_count * part / count,
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

LineBundlePart::LineBundlePart(const KernelInput& whole, const LineBundleLayout& layout,
                               const TileRows& tiles, int first, int last)
    : input_(whole),
      tile_rows_(tiles),
      first_(first),
      places_(static_cast<size_t>(whole.tile_count())) {
  input_.group_count = last - first;
  input_.first_entry += first;
  input_.first_group = first;

  std::vector<std::vector<int>> tiles_of_view;
  for (const KernelColumns& columns : layout.columns) {
    std::vector<int>& own = tiles_of_view.emplace_back();
    for (const int column : LocalColumns(input_, columns)) own.push_back(column / kTileSize);
    std::ranges::sort(own);
    const auto rest = std::ranges::unique(own);
    own.erase(rest.begin(), rest.end());
  }
  constexpr size_t kPanelBytes = sizeof(double) * kTileSize * kInstantColumns * kGroupSize;
  size_t reached = CutIntoBatches(tiles_of_view, 1);
  int groups = static_cast<int>(
      std::clamp<size_t>(kBatchBytes / (reached * kPanelBytes), 1, kMaxBatchGroups));
  while (true) {
    reached = CutIntoBatches(tiles_of_view, groups);
    if (groups == 1 || reached * kPanelBytes * static_cast<size_t>(groups) <= kBatchBytes) break;
    --groups;
  }
  input_.batch_groups = groups;
  coupling_ = AlignedBuffer(reached * kPanelBytes / sizeof(double) * static_cast<size_t>(groups));
  tiles_ = AlignedBuffer(tiles.count * kTileSize * kTileSize);

  size_t sums = 0;
  std::vector<size_t> offsets;
  for (const KernelColumns& columns : layout.columns) {
    const auto count = static_cast<size_t>(input_.LocalCount(columns));
    offsets.push_back(sums);
    sums += count * (count + 1) / 2 * kGroupSize;
  }
  view_sums_ = AlignedBuffer(sums);
  for (const size_t offset : offsets) view_sums_of_.push_back(view_sums_.data() + offset);
}

size_t LineBundlePart::CutIntoBatches(const std::vector<std::vector<int>>& tiles_of_view,
                                      int batch_groups) {
  batches_.clear();
  batch_tiles_.clear();
  masks_.clear();
  size_t most = 1;
  std::vector<uint64_t> masks(places_.size(), 0);  // of one batch, by tile
  std::vector<int> reached;
  for (int first = 0; first < input_.group_count; first += batch_groups) {
    const int last = std::min(first + batch_groups, input_.group_count);
    for (int group = first; group < last; ++group) {
      for (uint32_t e = input_.first_entry[group]; e < input_.first_entry[group + 1]; ++e) {
        const KernelEntry& entry = input_.entries[e];
        const uint64_t bits = static_cast<uint64_t>(entry.lanes) << ((group - first) * kGroupSize);
        for (const int tile : tiles_of_view[static_cast<size_t>(entry.view)]) {
          uint64_t& mask = masks[static_cast<size_t>(tile)];
          if (mask == 0) reached.push_back(tile);
          mask |= bits;
        }
      }
    }
    std::ranges::sort(reached);
    batches_.push_back({batch_tiles_.size(), static_cast<int>(reached.size())});
    for (const int tile : reached) {
      batch_tiles_.push_back(tile);
      masks_.push_back(std::exchange(masks[static_cast<size_t>(tile)], 0));
    }
    most = std::max(most, reached.size());
    reached.clear();
  }
  return most;
}

KernelEstimate LineBundlePart::Mine(KernelEstimate whole) const {
  whole.poses += static_cast<size_t>(first_) * kPoseLanes * kGroupSize;
  return whole;
}

void LineBundlePart::Linearise(const LineBundleKernel& kernel, const KernelEstimate& estimate,
                               double damping, bool curved, double* factors) {
  input_.curved = curved;
  const KernelEstimate mine = Mine(estimate);
  double* const my_factors = factors + static_cast<size_t>(first_) * kFactorLanes * kGroupSize;
  tiles_.Fill(0);
  view_sums_.Fill(0);
  linearisation_ = {};
  for (size_t b = 0; b < batches_.size(); ++b) {
    const Batch& own = batches_[b];
    KernelBatch batch;
    batch.first = static_cast<int>(b) * input_.batch_groups;
    batch.last = std::min(batch.first + input_.batch_groups, input_.group_count);
    batch.tile_count = own.tile_count;
    batch.tiles = batch_tiles_.data() + own.first_tile;
    batch.masks = masks_.data() + own.first_tile;
    batch.places = places_.data();
    for (int i = 0; i < own.tile_count; ++i) places_[static_cast<size_t>(batch.tiles[i])] = i;
    kernel.linearise(input_, batch, mine, damping, my_factors, view_sums_of_.data(),
                     coupling_.data(), &linearisation_);
    kernel.whiten(input_, batch, my_factors, coupling_.data());
    kernel.eliminate(input_, batch, tile_rows_.rows.data(), coupling_.data(), tiles_.data());
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
  matrix_ = Envelope(input_, layout);
  tile_rows_ = RowsOfTiles(matrix_);
  parts_ = CutIntoParts(input_, layout, tile_rows_);
  factors_ = AlignedBuffer(static_cast<size_t>(input_.group_count * kFactorLanes * kGroupSize));
  if (parts_.size() > 1) tiles_ = AlignedBuffer(parts_.front().tiles().size());
  view_sums_ = AlignedBuffer(parts_.front().view_sums().size());

  const int n = layout.column_count();
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
  matrix_.SetZero();
  gradient_.setZero();
  ScatterViewSums();
  estimate.AddPriors(&matrix_, &gradient_);
  const double* const tiles = (parts_.size() > 1 ? tiles_ : parts_.front().tiles()).data();
  // Rows of a tile begin here; row n is the gradient's.
  const auto tile_row = [&](Eigen::Index row, Eigen::Index column) {
    return tiles +
           (tile_rows_.rows[static_cast<size_t>(row / kTileSize)] + column / kTileSize) *
               kTileSize * kTileSize +
           row % kTileSize * kTileSize;
  };
  const int n = input_.column_count;
  for (size_t block = 0; block < matrix_.block_count(); ++block) {
    Eigen::MatrixXd& rows = matrix_.rows(block);
    const Eigen::Index begin = matrix_.RowOf(block), first = matrix_.FirstOf(block);
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      const Eigen::Index row = begin + i;
      double& diagonal = rows(i, row - first);
      diagonal_[row] = std::min(std::max(diagonal, kMinDiagonal), kMaxDiagonal);
      diagonal += damping_ * diagonal_[row];
    }
    // Tiles are rows of rows, the block is columns of columns.
    for (Eigen::Index column = first; column < first + rows.cols(); column += kTileSize) {
      const Eigen::Index wide = std::min<Eigen::Index>(kTileSize, first + rows.cols() - column);
      for (Eigen::Index i = std::max<Eigen::Index>(0, column - begin); i < rows.rows(); ++i) {
        const double* const from = tile_row(begin + i, column);
        for (Eigen::Index j = 0; j < std::min(wide, begin + i - column + 1); ++j) {
          rows(i, column - first + j) += from[j];
        }
      }
    }
  }
  for (int column = 0; column < n; ++column) {
    reduced_gradient_[column] = gradient_[column] + tile_row(n, column)[column % kTileSize];
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
