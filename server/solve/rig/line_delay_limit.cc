// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/line_delay_limit.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rigcal::server {
namespace {

constexpr double kLimitRounding = 1e-6;  // relative

}  // namespace

std::vector<double> LongestLineDelays(const RigObservations& rig) {
  std::vector<double> longest_s(rig.index.cameras.size(), std::numeric_limits<double>::infinity());
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    const auto camera = static_cast<size_t>(rig.index.camera_of_track[t]);
    const double period_s = rig.tracks[t].FramePeriodS();
    const double rows = rig.index.cameras[camera].image_size_px.height;
    if (!(period_s > 0) || !(rows > 0)) continue;
    longest_s[camera] = std::min(longest_s[camera], period_s / rows);
  }
  return longest_s;
}

bool IsAtLimit(double line_delay_s, double longest_s) {
  return std::abs(line_delay_s) >= (1 - kLimitRounding) * longest_s;
}

int HoldLongLineDelays(const std::vector<double>& longest_s, const std::vector<double>& delays_s,
                       BundleProblem* problem) {
  int held = 0;
  for (size_t c = 0; c < problem->cameras.size(); ++c) {
    BundleCamera& camera = problem->cameras[c];
    const double delay_s = delays_s[c] + camera.line_delay_s;
    if (camera.line_delay_fixed || std::abs(delay_s) <= longest_s[c]) continue;
    camera.line_delay_s = std::copysign(longest_s[c], delay_s) - delays_s[c];
    camera.line_delay_fixed = true;
    ++held;
  }
  return held;
}

}  // namespace rigcal::server
