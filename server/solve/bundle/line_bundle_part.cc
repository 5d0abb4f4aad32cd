// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_part.h"

#include <algorithm>

namespace rigcal::server {
namespace {

// A batch's coupling should stay in the second-level cache while it is multiplied with itself.
constexpr size_t kBatchBytes = 512 * 1024;

}  // namespace

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

LineBundlePart::LineBundlePart(const KernelInput& whole, const LineBundleLayout& layout, int first,
                               int last)
    : input_(whole), first_(first) {
  input_.group_count = last - first;
  input_.first_entry += first;

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
                               double damping, double* factors) {
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

}  // namespace rigcal::server
