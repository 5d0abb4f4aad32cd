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

// The problem's used markers in groups of eight instants, as the kernel reads them. Instants
// without a used marker are left out.
struct PackedMarkers {
  std::vector<int> instants;  // of the problem, in the order of lanes
  std::vector<KernelEntry> entries;
  std::vector<uint32_t> first_entry;
  AlignedBuffer data;
  int marker_count = 0;

  int group_count() const { return static_cast<int>(first_entry.size()) - 1; }
};

// Marks as shared those columns of the layout that several entries of one group reach.
PackedMarkers Pack(const BundleProblem& problem, LineBundleLayout* layout);

}  // namespace rigcal::server
