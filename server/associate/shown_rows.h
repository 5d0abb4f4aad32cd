// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "server/associate/camera_track.h"

namespace rigcal::server {

// A hash of what a row shows, whenever that was: equal where the same markers are at the same
// pixels, to the last bit. None of a row without a marker.
inline std::optional<uint64_t> HashOfShown(const Observation& row) {
  if (row.VisibleCount() == 0) return std::nullopt;
  const auto mixed = [](uint64_t hash, uint64_t value) {
    hash = (hash ^ value) * 0x9e3779b97f4a7c15u;
    return hash ^ (hash >> 29);
  };
  uint64_t hash = 1;
  for (size_t m = 0; m < row.markers.size(); ++m) {
    const MarkerObservation& marker = row.markers[m];
    if (!marker.visible) continue;
    hash = mixed(hash, m);
    hash = mixed(hash, std::bit_cast<uint64_t>(marker.centre_px.x()));
    hash = mixed(hash, std::bit_cast<uint64_t>(marker.centre_px.y()));
  }
  return hash;
}

}  // namespace rigcal::server
