// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "server/solve/bundle/marker_cost.h"

// The residuals of bundle_problem.h for automatic differentiation.

namespace rigcal::testing {

// Of a camera whose intrinsics are not estimated: constants, not parameters.
struct FixedIntrinsicsCost {
  server::MarkerFunctor marker;
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
