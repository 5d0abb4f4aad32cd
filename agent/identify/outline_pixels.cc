// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/outline_pixels.h"

#include <algorithm>

namespace rigcal::agent {

void OutlinePixels::Clear() {
  for (auto* values : {&x, &y, &coverage, &precision, &white, &saturated_behind}) {
    values->clear();
  }
  stick_side.clear();
  clipped = false;
}

void OutlinePixels::Add(float at_x, float at_y, float its_coverage, float its_precision,
                        float its_white, bool is_saturated_behind) {
  x.push_back(at_x);
  y.push_back(at_y);
  coverage.push_back(its_coverage);
  precision.push_back(its_precision);
  white.push_back(its_white);
  saturated_behind.push_back(is_saturated_behind ? 1.0f : 0.0f);
}

void OutlinePixels::FillUp() {
  while (!x.empty() && x.size() % kGroup != 0) Add(x.back(), y.back(), coverage.back(), 0);
}

bool OutlinePixels::IsOutshone() const {
  return std::ranges::any_of(saturated_behind, [](float one) { return one > 0; });
}

}  // namespace rigcal::agent
