// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_packing.h"

#include <algorithm>
#include <array>
#include <map>
#include <new>
#include <numeric>
#include <utility>

#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr size_t kCacheLine = 64;

// A marker and its place in a group.
struct Placement {
  const BundleObservation* observation;
  const BundleMarker* marker;
  size_t entry;  // of the group
  int lane;
};

class GroupPlacer {
 public:
  GroupPlacer(const BundleProblem& problem, const LineBundleLayout& layout)
      : problem_(problem), layout_(layout), drafts_of_view_(layout.views.size()) {}

  // `instants` of one group. Entries come sorted by view.
  void Place(const int* instants, int count) {
    for (const Draft& draft : drafts_) {
      drafts_of_view_[static_cast<size_t>(draft.entry.view)].clear();
    }
    drafts_.clear();
    placements_.clear();
    for (int lane = 0; lane < count; ++lane) {
      ForEachUsedMarker(problem_, problem_.instants[static_cast<size_t>(instants[lane])],
                        [&](const BundleObservation& observation, const BundleMarker& marker) {
                          const size_t draft = FindDraft(observation, marker.marker, lane);
                          placements_.push_back({&observation, &marker, draft, lane});
                        });
    }
    SortDrafts();
  }

  std::vector<KernelEntry> Entries() const {
    std::vector<KernelEntry> entries;
    for (const Draft& draft : drafts_) entries.push_back(draft.entry);
    return entries;
  }
  const std::vector<Placement>& placements() const { return placements_; }

 private:
  struct Draft {
    KernelEntry entry;
    std::array<const BundleObservation*, kGroupSize> observations = {};
    std::array<uint32_t, kGroupSize> taken = {};
  };

  // A camera seen twice in an instant, or a marker twice in an observation, opens another entry.
  size_t FindDraft(const BundleObservation& observation, int marker, int lane) {
    const int view = layout_.ViewIndex(observation.camera, observation.clock);
    std::vector<size_t>& candidates = drafts_of_view_[static_cast<size_t>(view)];
    const auto at = static_cast<size_t>(lane);
    const uint32_t bit = 1u << marker;
    const auto open = std::ranges::find_if(candidates, [&](size_t i) {
      const BundleObservation* const own = drafts_[i].observations[at];
      return (drafts_[i].taken[at] & bit) == 0 && (own == nullptr || own == &observation);
    });
    const size_t found = open == candidates.end() ? drafts_.size() : *open;
    if (found == drafts_.size()) {
      drafts_.emplace_back().entry.view = view;
      candidates.push_back(found);
    }
    Draft& draft = drafts_[found];
    draft.observations[at] = &observation;
    draft.taken[at] |= bit;
    draft.entry.slots |= bit;
    draft.entry.lanes = static_cast<uint8_t>(draft.entry.lanes | (1u << lane));
    return found;
  }

  void SortDrafts() {
    std::vector<size_t> order(drafts_.size()), rank(drafts_.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::ranges::stable_sort(order, {}, [this](size_t i) { return drafts_[i].entry.view; });
    std::vector<Draft> sorted;
    for (size_t i = 0; i < order.size(); ++i) {
      rank[order[i]] = i;
      sorted.push_back(drafts_[order[i]]);
    }
    drafts_ = std::move(sorted);
    for (Placement& placement : placements_) placement.entry = rank[placement.entry];
  }

  const BundleProblem& problem_;
  const LineBundleLayout& layout_;
  std::vector<std::vector<size_t>> drafts_of_view_;
  std::vector<Draft> drafts_;
  std::vector<Placement> placements_;
};

// Columns that two entries of one group add to.
void MarkShared(const PackedMarkers& packed, LineBundleLayout* layout) {
  // A group clears the columns of the views that it does not have, so columns of several views are
  // shared even if no group has two of them.
  std::map<int, int> views_of_camera, views_of_clock;
  const auto count = [&](const LineBundleLayout::View& view) {
    ++views_of_camera[view.camera];
    ++views_of_clock[view.clock];
  };
  for (const auto& view : layout->views) count(view);
  // Entries of a group are sorted by view.
  for (size_t group = 0; group + 1 < packed.first_entry.size(); ++group) {
    for (size_t e = packed.first_entry[group] + 1; e < packed.first_entry[group + 1]; ++e) {
      const int view = packed.entries[e].view;
      if (packed.entries[e - 1].view == view) count(layout->views[static_cast<size_t>(view)]);
    }
  }
  for (size_t v = 0; v < layout->views.size(); ++v) {
    KernelColumns& columns = layout->columns[v];
    columns.pose_shared = views_of_camera[layout->views[v].camera] > 1;
    for (int i = 0; i < columns.base_count; ++i) {
      columns.base_shared[i] = columns.base_kind[i] < ViewUnknowns::kFirstIntrinsic
                                   ? views_of_clock[layout->views[v].clock] > 1
                                   : columns.pose_shared;
    }
  }
}

void Fill(const Placement& placement, const KernelEntry& entry, double* data) {
  const int lane = placement.lane;
  double* const at = data + entry.data;
  at[lane] = placement.observation->clock_time_s;
  const uint32_t below = entry.slots & ((1u << placement.marker->marker) - 1);
  double* const slot = at + kGroupSize * (1 + kSlotLanes * __builtin_popcount(below));
  const MeasuredMarker<double> m = ToMeasured(*placement.marker);
  const double values[kSlotLanes] = {m.a,         m.b,           m.c,          m.centre[0],
                                     m.centre[1], m.velocity[0], m.velocity[1]};
  for (int i = 0; i < kSlotLanes; ++i) slot[i * kGroupSize + lane] = values[i];
}

}  // namespace

AlignedBuffer::AlignedBuffer(size_t size) : size_(size) {
  const size_t bytes =
      (std::max<size_t>(size, 1) * sizeof(double) + kCacheLine - 1) / kCacheLine * kCacheLine;
  data_.reset(static_cast<double*>(std::aligned_alloc(kCacheLine, bytes)));
  if (data_ == nullptr) throw std::bad_alloc();
  Fill(0);
}

void AlignedBuffer::Fill(double value) { std::fill_n(data_.get(), size_, value); }

PackedMarkers Pack(const BundleProblem& problem, LineBundleLayout* layout) {
  PackedMarkers packed;
  packed.marker_count = static_cast<int>(problem.target.marker_positions_m.size());
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    bool any = false;
    ForEachUsedMarker(problem, problem.instants[i],
                      [&any](const BundleObservation&, const BundleMarker&) { any = true; });
    if (any) packed.instants.push_back(static_cast<int>(i));
  }
  GroupPlacer placer(problem, *layout);
  const int instant_count = static_cast<int>(packed.instants.size());
  const auto place = [&](int first) {
    placer.Place(packed.instants.data() + first, std::min(kGroupSize, instant_count - first));
  };
  size_t size = 0;
  packed.first_entry.push_back(0);
  for (int first = 0; first < instant_count; first += kGroupSize) {
    place(first);
    for (KernelEntry entry : placer.Entries()) {
      entry.data = size;
      size += static_cast<size_t>(kGroupSize * (1 + kSlotLanes * __builtin_popcount(entry.slots)));
      packed.entries.push_back(entry);
    }
    packed.first_entry.push_back(static_cast<uint32_t>(packed.entries.size()));
  }
  packed.data = AlignedBuffer(size);
  for (int group = 0; group < packed.group_count(); ++group) {
    place(group * kGroupSize);
    for (const Placement& placement : placer.placements()) {
      Fill(placement,
           packed.entries[packed.first_entry[static_cast<size_t>(group)] + placement.entry],
           packed.data.data());
    }
  }
  MarkShared(packed, layout);
  return packed;
}

}  // namespace rigcal::server
