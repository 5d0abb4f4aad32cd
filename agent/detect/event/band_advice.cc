// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/band_advice.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

// Less is no tolerance for LEDs and latency.
constexpr double kLeastBand = 0.01;
// The wand's own markers must be within this part of the band.
constexpr double kOwnPart = 0.5;

}  // namespace

std::optional<BandAdvice> AdviseBand(const std::vector<BlinkBlob>& blobs, size_t marker_count,
                                     const std::vector<double>& blink_hz) {
  if (blobs.size() <= marker_count || marker_count == 0) return std::nullopt;
  struct Light {
    double away_rel = 0, hz = 0;
  };
  std::vector<Light> lights;
  for (const BlinkBlob& blob : blobs) {
    const double hz = blink_hz[static_cast<size_t>(blob.frequency)];
    lights.push_back({std::abs(1e-6 * blob.period_us * hz - 1), 1e6 / blob.period_us});
  }
  std::sort(lights.begin(), lights.end(),
            [](const Light& a, const Light& b) { return a.away_rel < b.away_rel; });
  const Light& last_own = lights[marker_count - 1];
  const Light& first_other = lights[marker_count];
  const double band_rel = 0.5 * (last_own.away_rel + first_other.away_rel);
  if (band_rel < kLeastBand || last_own.away_rel > kOwnPart * band_rel) return std::nullopt;
  return BandAdvice{.band_rel = band_rel, .other_hz = first_other.hz};
}

}  // namespace rigcal::agent
