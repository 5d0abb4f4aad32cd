// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/whole_candidate.h"

#include <algorithm>
#include <numbers>

namespace rigcal::agent {

Blob DiscBlob(const Eigen::Vector2d& centre_px, double radius_px) {
  Blob disc;
  disc.centre_px = centre_px;
  disc.area_px = static_cast<int>(std::numbers::pi * radius_px * radius_px);
  disc.second_moment_px2 = 0.25 * radius_px * radius_px * Eigen::Matrix2d::Identity();
  return disc;
}

std::optional<WandCandidate> WholeCandidate(const WandFinder& finder, const VerifiedWand& wand,
                                            std::vector<Blob>* blobs) {
  const auto hidden =
      static_cast<size_t>(std::ranges::find(wand.whole, false) - wand.whole.begin());
  if (hidden == wand.whole.size() || wand.px_per_m.size() != wand.whole.size()) return std::nullopt;
  double radius_px = 0;
  for (size_t k = 0; k < wand.whole.size(); ++k) {
    if (!wand.whole[k]) continue;
    radius_px =
        std::max(radius_px, wand.centres[k].radius_px * wand.px_per_m[hidden] / wand.px_per_m[k]);
  }
  const double share = finder.shares()[hidden];
  Eigen::Vector2d centre_px;
  if (!finder.ImageOf((1 - share) * wand.fit.first_m + share * wand.fit.last_m, &centre_px)) {
    return std::nullopt;
  }
  WandCandidate whole{.blobs = wand.blobs, .fit = wand.fit};
  whole.blobs[hidden] = static_cast<int>(blobs->size());
  blobs->push_back(DiscBlob(centre_px, radius_px));
  return whole;
}

}  // namespace rigcal::agent
