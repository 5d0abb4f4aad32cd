// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_stick.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

constexpr double kHalfShare = 0.25, kHalfPx = 1.0;  // half the band's width: share of radius + px
constexpr double kBlurPx = 1.5;       // of the outline: the band begins further inside by this
constexpr double kUsualEdgePx = 0.7;  // softer edges blur the stick more

}  // namespace

void MarkStick(const VerifiedWand& wand, size_t marker, const SphereOutline& outline,
               OutlinePixels* pixels) {
  pixels->stick_side.assign(pixels->size(), 0);
  const size_t before = marker == 0 ? 0 : marker - 1;
  const size_t after = marker + 1 < wand.centres.size() ? marker + 1 : marker;
  const Eigen::Vector2d way_px = wand.centres[after].centre_px - wand.centres[before].centre_px;
  if (!(way_px.norm() > outline.radius_px)) return;
  const Eigen::Vector2d along = way_px.normalized();
  const double softer_px = std::max(0.0, outline.edge_px - kUsualEdgePx);
  const double half_px = kHalfShare * outline.radius_px + kHalfPx + softer_px;
  const double leaves_px = outline.radius_px * std::cos(wand.fit.tilt_rad) - kBlurPx - softer_px;
  for (size_t i = 0; i < pixels->size(); ++i) {
    const Eigen::Vector2d d(static_cast<double>(pixels->x[i]) - outline.centre_px.x(),
                            static_cast<double>(pixels->y[i]) - outline.centre_px.y());
    if (std::abs(d.x() * along.y() - d.y() * along.x()) > half_px) continue;
    const double ahead_px = d.dot(along);
    if (ahead_px < -leaves_px) pixels->stick_side[i] = 1;
    if (ahead_px > leaves_px) pixels->stick_side[i] = 2;
  }
}

}  // namespace rigcal::agent
