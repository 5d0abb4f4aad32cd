// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/line_bundle_kernel.h"
#include "server/solve/bundle/line_bundle_layout.h"

namespace rigcal::server {

// Doubles that begin on a cache line, zero at first.
class AlignedBuffer {
 public:
  AlignedBuffer() = default;
  explicit AlignedBuffer(size_t size);

  double* data() { return data_.get(); }
  const double* data() const { return data_.get(); }
  size_t size() const { return size_; }
  void Fill(double value);

 private:
  struct Free {
    void operator()(double* data) const { std::free(data); }
  };
  std::unique_ptr<double, Free> data_;
  size_t size_ = 0;
};

// Data of more bytes is not kept but made group by group whenever the kernel reads it, which costs
// an eighth of the time and saves a third of a solve's memory.
inline constexpr size_t kMaxPackedBytes = size_t{32} << 20;

// The problem's used markers in groups of eight instants, as the kernel reads them. Instants
// without a used marker are left out.
struct PackedMarkers {
  std::vector<int> instants;  // of the problem, in the order of lanes
  std::vector<KernelEntry> entries;
  std::vector<uint32_t> first_entry;
  mutable AlignedBuffer data;  // of all groups; with a source, of the group loaded last
  int marker_count = 0;
  // Where not all data is kept.
  const BundleProblem* source = nullptr;
  std::vector<uint16_t> places;     // entry within its group, by used marker
  std::vector<size_t> first_place;  // by group

  // Puts a group of the source into `data`; for one thread at a time.
  void Load(int group) const;

  int group_count() const { return static_cast<int>(first_entry.size()) - 1; }
};

// The problem must outlive the result, and its markers must stay as they are.
PackedMarkers Pack(const BundleProblem& problem, const LineBundleLayout& layout,
                   size_t max_bytes = kMaxPackedBytes);

}  // namespace rigcal::server
