// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_packing.h"

#include <algorithm>
#include <array>
#include <new>
#include <numeric>
#include <utility>

#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr size_t kCacheLine = 64;

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
    entry_of_marker_.clear();
    for (int lane = 0; lane < count; ++lane) {
      ForEachUsedMarker(problem_, problem_.instants[static_cast<size_t>(instants[lane])],
                        [&](const BundleObservation& observation, const BundleMarker& marker) {
                          const size_t draft = FindDraft(observation, marker.marker, lane);
                          entry_of_marker_.push_back(draft);
                        });
    }
    SortDrafts();
  }

  std::vector<KernelEntry> Entries() const {
    std::vector<KernelEntry> entries;
    for (const Draft& draft : drafts_) entries.push_back(draft.entry);
    return entries;
  }
  // By used marker of the group.
  const std::vector<size_t>& entry_of_marker() const { return entry_of_marker_; }

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
    for (size_t& entry : entry_of_marker_) entry = rank[entry];
  }

  const BundleProblem& problem_;
  const LineBundleLayout& layout_;
  std::vector<std::vector<size_t>> drafts_of_view_;
  std::vector<Draft> drafts_;
  std::vector<size_t> entry_of_marker_;
};

size_t Doubles(const KernelEntry& entry) {
  return static_cast<size_t>(kGroupSize * (1 + kSlotLanes * __builtin_popcount(entry.slots)));
}

void Fill(const BundleObservation& observation, const BundleMarker& marker, int lane,
          const KernelEntry& entry, double* data) {
  double* const at = data + entry.data;
  at[lane] = observation.clock_time_s;
  const uint32_t below = entry.slots & ((1u << marker.marker) - 1);
  double* const slot = at + kGroupSize * (1 + kSlotLanes * __builtin_popcount(below));
  const MeasuredMarker<double> m = ToMeasured(marker);
  const double values[kSlotLanes] = {m.a,         m.b,           m.c,          m.centre[0],
                                     m.centre[1], m.velocity[0], m.velocity[1]};
  for (int i = 0; i < kSlotLanes; ++i) slot[i * kGroupSize + lane] = values[i];
}

// Replaces the source by the data of all its groups.
void StoreAll(size_t size, PackedMarkers* packed) {
  AlignedBuffer data(size);
  size_t begin = 0;
  for (int group = 0; group < packed->group_count(); ++group) {
    packed->Load(group);
    const auto g = static_cast<size_t>(group);
    size_t end = begin;
    for (uint32_t e = packed->first_entry[g]; e < packed->first_entry[g + 1]; ++e) {
      const KernelEntry& entry = packed->entries[e];
      end = begin + entry.data + Doubles(entry);
    }
    std::copy_n(packed->data.data(), end - begin, data.data() + begin);
    for (uint32_t e = packed->first_entry[g]; e < packed->first_entry[g + 1]; ++e) {
      packed->entries[e].data += begin;
    }
    begin = end;
  }
  packed->data = std::move(data);
  packed->source = nullptr;
  packed->places = std::vector<uint16_t>();
  packed->first_place = std::vector<size_t>();
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

void PackedMarkers::Load(int group) const {
  const auto g = static_cast<size_t>(group);
  double* const to = data.data();
  const KernelEntry* const own = entries.data() + first_entry[g];
  const KernelEntry& last = entries[first_entry[g + 1] - 1];
  std::fill_n(to, last.data + Doubles(last), 0.0);
  const uint16_t* place = places.data() + first_place[g];
  const size_t first = g * kGroupSize;
  const size_t count = std::min<size_t>(kGroupSize, instants.size() - first);
  for (size_t lane = 0; lane < count; ++lane) {
    ForEachUsedMarker(*source, source->instants[static_cast<size_t>(instants[first + lane])],
                      [&](const BundleObservation& observation, const BundleMarker& marker) {
                        Fill(observation, marker, static_cast<int>(lane), own[*place++], to);
                      });
  }
}

PackedMarkers Pack(const BundleProblem& problem, const LineBundleLayout& layout, size_t max_bytes) {
  PackedMarkers packed;
  packed.marker_count = static_cast<int>(problem.target.marker_positions_m.size());
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    bool any = false;
    ForEachUsedMarker(problem, problem.instants[i],
                      [&any](const BundleObservation&, const BundleMarker&) { any = true; });
    if (any) packed.instants.push_back(static_cast<int>(i));
  }
  GroupPlacer placer(problem, layout);
  const int instant_count = static_cast<int>(packed.instants.size());
  packed.places.reserve(problem.markers.size());
  size_t all = 0, largest = 0;
  packed.first_entry.push_back(0);
  for (int first = 0; first < instant_count; first += kGroupSize) {
    placer.Place(packed.instants.data() + first, std::min(kGroupSize, instant_count - first));
    size_t size = 0;
    for (KernelEntry entry : placer.Entries()) {
      entry.data = size;
      size += Doubles(entry);
      packed.entries.push_back(entry);
    }
    packed.first_entry.push_back(static_cast<uint32_t>(packed.entries.size()));
    packed.first_place.push_back(packed.places.size());
    for (const size_t entry : placer.entry_of_marker()) {
      packed.places.push_back(static_cast<uint16_t>(entry));
    }
    all += size;
    largest = std::max(largest, size);
  }
  packed.source = &problem;
  packed.data = AlignedBuffer(largest);
  if (all * sizeof(double) <= max_bytes) StoreAll(all, &packed);
  return packed;
}

}  // namespace rigcal::server
