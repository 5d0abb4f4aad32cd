// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "server/solve/bundle/marker_cost.h"

// The residuals of bundle_problem.h for automatic differentiation.

namespace rigcal::testing {

// Line delays are not estimated here: a constant, not a parameter.
struct FixedLineDelayCost {
  server::MarkerFunctor marker;
  double line_delay_s;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* intrinsics, const T* offset,
                  const T* rate, const T* position, const T* target, T* residuals) const {
    const T line_delay(line_delay_s);
    return marker(rotation, translation, intrinsics, offset, rate, &line_delay, position, target,
                  residuals);
  }
};

// Of a camera whose intrinsics are not estimated either.
struct FixedIntrinsicsCost {
  FixedLineDelayCost marker;
  std::array<double, kMaxIntrinsics> values;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* offset, const T* rate,
                  const T* position, const T* target, T* residuals) const {
    T intrinsics[kMaxIntrinsics];
    for (size_t i = 0; i < values.size(); ++i) intrinsics[i] = T(values[i]);
    return marker(rotation, translation, intrinsics, offset, rate, position, target, residuals);
  }
};

// (plus - minus - mean) / sigma
struct DifferencePrior {
  double mean, sigma;
  template <typename T>
  bool operator()(const T* minus, const T* plus, T* residual) const {
    *residual = (*plus - *minus - T(mean)) / T(sigma);
    return true;
  }
};
struct ScalarPrior {
  double mean, sigma;
  int component;
  template <typename T>
  bool operator()(const T* value, T* residual) const {
    *residual = (value[component] - T(mean)) / T(sigma);
    return true;
  }
};

}  // namespace rigcal::testing
