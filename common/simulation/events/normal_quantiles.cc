// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/normal_quantiles.h"

#include <cmath>
#include <numbers>

namespace rigcal {

NormalQuantiles::NormalQuantiles() {
  double sigma = 0;
  for (size_t i = 0; i < kCount / 2; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / kCount;
    // Newton on the distribution above its middle, from the value before.
    for (int step = 0; step < 8; ++step) {
      const double beyond = 0.5 * std::erf(sigma / std::numbers::sqrt2) - share;
      const double density = std::exp(-0.5 * sigma * sigma) / std::sqrt(2 * std::numbers::pi);
      sigma -= beyond / density;
    }
    values_[kCount / 2 + i] = static_cast<float>(sigma);
    values_[kCount / 2 - 1 - i] = static_cast<float>(-sigma);
  }
}

}  // namespace rigcal
