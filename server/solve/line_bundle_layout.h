// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <vector>

#include "server/solve/bundle_problem.h"
#include "server/solve/line_bundle.h"
#include "server/solve/line_bundle_kernel.h"

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

// A normal prior on a free parameter, or on the difference of two: (plus - minus - mean) / sigma.
struct ReducedPrior {
  int plus = -1;   // column
  int minus = -1;  // column; -1: none
  double mean = 0;
  double inverse_sigma = 0;
};

// The free parameters besides the instants, in columns: camera by camera its pose, its intrinsics
// and the clocks it is the first to use, then the marker positions.
struct LineBundleLayout {
  struct View {
    int camera = 0;
    int clock = 0;
  };
  std::vector<ReducedParameter> parameters;
  std::vector<ReducedPrior> priors;
  std::vector<View> views;
  std::vector<KernelColumns> columns;  // by view
  int spacing_column = -1;
  std::vector<int> view_index;  // by camera, by clock; -1: no used marker
  int clock_count = 0;

  int column_count() const { return static_cast<int>(parameters.size()); }
  int& ViewIndex(int camera, int clock) {
    return view_index[static_cast<size_t>(camera * clock_count + clock)];
  }
  int ViewIndex(int camera, int clock) const {
    return view_index[static_cast<size_t>(camera * clock_count + clock)];
  }
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

LineBundleLayout LayOut(const BundleProblem& problem);
// Marks as shared those columns of the layout that several entries of one group reach.
PackedMarkers Pack(const BundleProblem& problem, LineBundleLayout* layout);

}  // namespace rigcal::server
