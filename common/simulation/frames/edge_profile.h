// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace rigcal {

// The share of a pixel's light that comes from beyond a straight edge, by the signed distance of
// the pixel's centre from that edge: the step, blurred by the square pixel (its mean over all
// directions of the edge), by a Gaussian and by a uniform disc. A table.
class EdgeProfile {
 public:
  // One sigma of the Gaussian and the radius of the disc, >= 0.
  EdgeProfile(double gaussian_px, double disc_px);

  // `inside_px`: distance of the pixel's centre from the edge, positive on the bright side.
  // From 0 far outside to 1 far inside; At(-d) == 1 - At(d).
  float At(float inside_px) const {
    const float position = (inside_px + reach_px_) * kStepsPerPx;
    if (!(position > 0)) return 0;
    if (position >= last_) return 1;
    const auto index = static_cast<size_t>(position);
    const float share = position - static_cast<float>(index);
    return table_[index] + share * (table_[index + 1] - table_[index]);
  }
  // Beyond this distance At is 0 or 1.
  float reach_px() const { return reach_px_; }
  // Of the whole blur, along one axis. A curved edge of radius r looks as if it lay
  // variance / (2 r) nearer to its centre of curvature.
  double variance_px2() const { return variance_px2_; }

 private:
  static constexpr float kStepsPerPx = 64;
  double variance_px2_ = 0;
  float reach_px_ = 0;
  float last_ = 0;
  std::vector<float> table_;
};

}  // namespace rigcal
