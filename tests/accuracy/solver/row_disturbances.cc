// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Core>
#include <algorithm>
#include <random>
#include <utility>

#include "tests/accuracy/solver/disturbance.h"

namespace rigcal::accuracy {
namespace {

// Rows of the image are taken one after the other, `line_s` apart: the middle one at the stamp.
void RollShutter(double line_s, server::CameraTrack* track) {
  const std::vector<Observation> before = track->observations;
  const double middle_px = 0.5 * track->camera.image_size_px.height;
  for (size_t i = 1; i + 1 < before.size(); ++i) {
    const Observation &last = before[i - 1], &next = before[i + 1];
    const double span_s = 1e-9 * static_cast<double>(next.time_ns - last.time_ns);
    Observation& row = track->observations[i];
    for (size_t m = 0; m < row.markers.size(); ++m) {
      if (!row.markers[m].visible || last.markers.size() <= m || next.markers.size() <= m ||
          !last.markers[m].visible || !next.markers[m].visible || span_s > 0.3) {
        continue;
      }
      const Eigen::Vector2d velocity_px_s =
          (next.markers[m].centre_px - last.markers[m].centre_px) / span_s;
      row.markers[m].centre_px +=
          line_s * (row.markers[m].centre_px.y() - middle_px) * velocity_px_s;
    }
  }
}

void FlipLabels(uint32_t seed, double share, server::CameraTrack* track) {
  std::mt19937 random(seed);
  std::bernoulli_distribution flipped(share);
  for (Observation& row : track->observations) {
    if (row.markers.size() > 1 && flipped(random)) {
      std::swap(row.markers.front(), row.markers.back());
    }
  }
}

void DropRows(uint32_t seed, double share, server::CameraTrack* track) {
  std::mt19937 random(seed);
  std::bernoulli_distribution dropped(share);
  std::erase_if(track->observations, [&](const Observation&) { return dropped(random); });
}

}  // namespace

std::vector<Disturbance> RowDisturbances() {
  const auto shutter = [](double line_s) {
    return [line_s](uint32_t, server::CameraTrack* track) { RollShutter(line_s, track); };
  };
  const auto drop = [](double share) {
    return [share](uint32_t seed, server::CameraTrack* track) { DropRows(seed, share, track); };
  };
  const std::vector<FindingKind> rolling = {FindingKind::kRollingShutter};
  return {
      OfTrack("rolling shutter 15 us, one", rolling, false, shutter(15e-6)),
      OfTrack("rolling shutter 15 us, all", rolling, true, shutter(15e-6)),
      OfTrack("labels flipped in 10 %", {FindingKind::kFlippedLabels}, false,
              [](uint32_t seed, server::CameraTrack* track) { FlipLabels(seed, 0.1, track); }),
      OfTrack("half of the rows dropped", {}, true, drop(0.5)),
  };
}

}  // namespace rigcal::accuracy
